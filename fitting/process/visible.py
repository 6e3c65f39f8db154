"""Text of files and of the command line, made safe for terminals, pages and pictures."""

from __future__ import annotations


def visible(text: str, keep: str = "") -> str:
    """Return ``text`` with control, escape and other invisible characters written as escapes.

    A cell may contain terminal commands, a mark that changes the direction of writing, or a byte
    that XML does not allow. keep: characters that stay, such as line ends.
    """
    if text.isascii() and text.isprintable():
        return text
    bad = {sign for sign in set(text) if not (sign.isprintable() or sign.isspace() or sign in keep)}
    bad |= {sign for sign in set(text) if sign in "\t\n\r\v\f\x1c\x1d\x1e\x1f\x85\u2028\u2029"}
    bad -= set(keep)
    return text.translate({ord(sign): ascii(sign)[1:-1] for sign in bad})
