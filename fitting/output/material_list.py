"""The named materials, a line each: what ``fresnel-fit --materials`` prints."""

from __future__ import annotations

from fitting.samples.known_media import PREFIX, search_database
from fresnel_jax import materials


def material_list(words: str = "") -> str:
    """Return names, wavelengths in micrometres, source and conditions of all named materials.

    words: "ri:gold" for the entries of the refractiveindex.info database with gold in name or
    title. Raises ValueError where there are none, or for other words.
    """
    if words:
        if not words.startswith(PREFIX):
            raise ValueError(f"{words!r} came; {PREFIX}gold looks for gold in the database.")
        entries = search_database(words)
        if not entries:
            raise ValueError(f"no entry of the database has {words.removeprefix(PREFIX)!r}.")
        wide = max(len(name) for name, _ in entries)
        return "\n".join(f"{name:<{wide}}  {title}" for name, title in entries)
    rows = [("name", "wavelengths, um", "source; conditions")]
    for name in materials.names():
        record = materials.lookup(name)
        low, high = record.range_um or (None, None)
        known = "all" if low is None else f"{low:.4g} to {high:.4g}"
        notes = (record.source, record.doi and f"doi:{record.doi}", record.note)
        rows.append((", ".join((name, *record.aliases)), known, "; ".join(filter(None, notes))))
    wide, known = (max(len(row[i]) for row in rows) for i in (0, 1))
    return "\n".join(f"{row[0]:<{wide}}  {row[1]:<{known}}  {row[2]}" for row in rows)
