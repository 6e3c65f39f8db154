"""The words of measured files: every name of an angle, a polarization, a unit, a quantity, an axis.

One list for headers, comments, metadata and file names, in the languages in which such files were
seen. A word is written here without accents and in small letters; `words_of` brings text to that.
"""

from __future__ import annotations

import re
import unicodedata
from typing import NamedTuple

LONGEST = 200  # letters of a column's name; what is longer is a text
_CONCEPTS = {
    # angle of incidence: named outright, or an angle of some kind
    "incidence": "aoi incidence incidencia incidenza einfallswinkel invalshoek invallend einfall "
    "падения padania dopadu infallsvinkel indfaldsvinkel innfallsvinkel 入射角 入射角度 入射 "
    "입사각",
    "normal": "normal normale normaal normalen senkrechter senkrechtem нормальное нормальном",
    "angle": "angle angles angular winkel angolo angoli angulo angulos hoek theta phi incident "
    "угол угла углы 角 角度",
    "grazing": "grazing glancing streifwinkel streifend streifender glanzwinkel rasant rasante "
    "radente скользящий скользящего 掠射 掠入射 掠射角",
    "doubled": "2theta 2th tth twotheta",
    "transfer": "q qz momentum transfer",
    "no incidence": "mount motor stage position rotation rotated rotator goniometer detector "
    "azimuth azimuthal analyzer analyser analysator compensator kompensator retarder retardance "
    "waveplate tilt phase latitude divergence acceptance aperture slit temperature celsius bragg",
    # wavelength
    "wavelength": "wavelength wavelengths lambda wl wvl wellenlange wellenlaenge wellenlangen "
    "longueur onde lunghezza onda longitud comprimento golflengte длина волны 波长 波長",
    "laser": "laser",
    "energy": "energy energies energie energia photon photonenenergie hv энергия 能量 光子能量",
    "wavenumber": "wavenumber wavenumbers wellenzahl wellenzahlen число 波数",
    "frequency": "frequency freq frequenz frequence frecuencia частота 频率",
    # measured quantities
    "R": "refl reflectance reflectances reflectivity reflection reflexion reflektion reflektanz "
    "reflektivitat reflexionsgrad reflectivite riflettanza riflettivita reflectancia reflectividad "
    "refletancia refletividade reflectie отражение отражения 反射率 反射",
    "T": "trans transmittance transmission transmissivity transmissionsgrad transmittanz "
    "transmissionen trasmittanza trasmissione transmitancia transmision пропускание пропускания "
    "透过率 透射率 透過率",
    "A": "absorbance absorptance absorption absorptivity extinktion extinction absorbanz",
    "psi": "psi",
    "delta": "delta",
    "relative": "relative relativ relatif relativa relativo rel fractional cv rsd",
    "error": "std sd stdev stddev sigma err error errors unc uncert uncertainty uncertainties se "
    "sem stderr fehler unsicherheit standardabweichung incertezza incertitude erreur errore "
    "погрешность 误差 标准差",
    "raw": "signal intensity intensities intensitat voltage current counts photocurrent irradiance "
    "i reference",
    "constant": "n k nk eps epsilon e1 e2 index",
    # polarization
    "polarization": "polarization polarisation polarized polarised pol polarisierung polarisiert "
    "polarisiertes polarizzazione polarizzata polarizacion polarizada polarizado polarisee "
    "polarise polarisatie polarizzato polarizacao поляризация 偏振 偏光",
    "polarizer": "polarizer polariser polarisator polariseur polarizzatore polarizador поляризатор "
    "偏振片 起偏器",
    "s": "s te perp perpendicular senkrecht spol ss perpendiculaire perpendicolare",
    "p": "p tm par para parallel ppol pp parallele parallelo parallela paralela paralelo",
    "u": "unpolarized unpolarised unpol u mixed natural naturliches unpolarisiert",
    "none": "none without ohne keine sans",
    "wave": "wave waves welle",
    # the surface, and the side of a plate
    "surface": "surface oberflache superficie поверхность поверхности 表面",
    "back": "back rear ruckseite",
    # words that change nothing, in a header and in a sentence
    "filler": "of the at for value values data measured meas light beam total specular front "
    "power avg average ave mean experimental exp col column",
    "article": "per is in en im zur zum from was with as are all unit units given set fixed "
    "constant mode state a and d de di du da do del der des die das l la le von et und e y near "
    "nominal mit bei licht lumiere luce luz number no коэффициент",
}
CONCEPT = {word: concept for concept, words in _CONCEPTS.items() for word in words.split()}
LETTERS = frozenset("spu")
# what an unknown word speaks of if it holds one of these: compounds, scripts that part no words
_ROOTS = {w: c for w, c in CONCEPT.items() if not w.isascii() and len(w) > 1} | {
    "winkel": "angle", "vinkel": "angle", "einfall": "incidence", "polari": "polarization",
    "polary": "polarization",
}  # fmt: skip
QUANTITY_CONCEPTS = ("R", "T", "A", "psi", "delta")
AXIS_CONCEPTS = ("wavelength", "energy", "wavenumber", "frequency")

_UNIT_SPELLINGS = {
    "deg": "deg degs degree degrees 度 grad grade grados gradi graus degres graden "
    "градус градуса градусов stopni stupnu",
    "rad": "rad rads radian radians radiant radianti radianes radianten bogenmass "
    "bogenmaß радиан радианы радианах 弧度",
    "mrad": "mrad milliradian milliradians",
    "deg.arcmin": "deg.arcmin degrees.arcminutes",
    "grazing-deg": "grazing-deg",
    "grazing-rad": "grazing-rad",
    "2theta-deg": "2theta-deg 2theta",
    "1/angstrom": "1/angstrom 1/angstroms 1/a a^-1 a-1 angstrom^-1 angstrom-1 inv_angstrom",
    "1/nm": "1/nm nm^-1 nm-1",
    "nm": "nm nanometer nanometers nanometre nanometres nanometro nanometri nanometros",
    "um": "um micron microns micrometer micrometers micrometre micrometres mikrometer micrometro "
    "micrometri micrometros mum mkm",
    "angstrom": "angstrom angstroms a ang aa",
    "mm": "mm",
    "eV": "ev electronvolt electronvolts electron_volt",
    "keV": "kev",
    "cm-1": "cm-1 cm^-1 1/cm cm**-1 cm^(-1 kayser wavenumbers",
    "THz": "thz",
    "percent": "% percent cent per_cent pct prozent pourcent percento porcentaje процент процентах "
    "百分比",
    "permille": "\u2030 permille promille mille per_mille per_mil permil",
    "1": "1 - -- none fraction fractions dimensionless ratio abs 0..1 0-1 [] au/au",
    "arb": "a.u. arb arb. arb.u. arb.units arb._units arbitrary arbitrary_units counts cts cps v mv"
    " volt volts uv ma ua na pa w mw uw db",
}
UNITS = {word: unit for unit, words in _UNIT_SPELLINGS.items() for word in words.split()}

_SIGNS = {
    "\u00b5": "u", "\u03bc": "u",
    "\u00c5": "angstrom", "\u212b": "angstrom",
    "\u00b0": "deg", "\u02da": "deg", "\u00ba": "deg", "\u2103": " celsius ",
    "\u22a5": " perp ", "\u27c2": " perp ", "\u2225": " par ", "\u2016": " par ", "\u2afd": " par ",
    "\u2212": "-", "\u2013": "-", "\u2010": "-", "\u2011": "-", "\u207b": "-",
    "\u00b9": "1", "\u00b2": "2", "\u00b1": " error ", "\u00b4": "'", "\u2019": "'",
    "\u03bb": "lambda",
    "\u03b8": "theta", "\u0398": "theta", "\u03d1": "theta", "\u03c8": "psi", "\u03a8": "psi",
    "\u03c6": "phi", "\u03d5": "phi", "\u0394": "Delta", "\u2206": "Delta", "\u03b4": "delta",
    "\u03c3": "sigma", "\u03bd": "nu",
}  # fmt: skip
_TRANSLATION = str.maketrans(_SIGNS)


def _letter(sign: str) -> str:
    """Return a letter without its accent; any other sign as it is."""
    if sign.isascii() or not sign.isalpha():
        return sign
    bare = "".join(c for c in unicodedata.normalize("NFKD", sign) if not unicodedata.combining(c))
    return bare if bare.isascii() else sign


def plain(text: str) -> str:
    """Return ``text`` with Greek letters as words, typographic signs as ASCII ones, no accents.

    What stands for nothing here (other scripts, primes, roots) stays, so that it can be refused.
    """
    if text.isascii():
        return text
    text = unicodedata.normalize(
        "NFC", text.replace("\u00b0C", " celsius ").translate(_TRANSLATION)
    )
    return "".join(map(_letter, text))


def spelled(text: str) -> str:
    """Return ``plain`` text with names of several parts as one word: 2 theta, wave length."""
    text = re.sub(r"(?i)\b[dl]'(?=\w)", "", plain(text))  # angle d'incidence
    text = re.sub(r"@\s*(?=[0-9])", " angle ", text)  # R@60
    text = re.sub(r"(?i)(?<![^\W_])(?:2|two)[\s_-]*theta", "twotheta", text)
    return re.sub(r"(?i)(?<![^\W_])wave[\s_-]+(?=length|number)", "wave", text)


def light_of(word: str) -> str:
    """Return "s", "p" or "u" of a word for one polarization, "" of any other."""
    concept = CONCEPT.get(word, "")
    return concept if concept in LETTERS else ""


def unit_of(text: str) -> str | None:
    """Return the unit that ``text`` spells (a key such as nm, deg, percent), or None."""
    if len(text) > 40:
        return None
    word = re.sub(r"\s+", "_", plain(text).strip().strip("[](){}").strip().lower())
    return UNITS.get(word.replace("{", "").replace("}", "").replace("$", ""))


class Words(NamedTuple):
    """What a piece of text says: words in small letters, numbers (as written), units of it.

    concepts: concept of each known word. numbers: (number, unit behind it or "").
    units: units that stand behind no number. unknown: whether any word is not in the vocabulary.
    capitals: words of the text as they are written.
    """

    concepts: set[str]
    numbers: list[tuple[float, str]]
    units: set[str]
    unknown: bool
    capitals: list[str]


_WORD = re.compile(
    r"(?P<number>(?<![^\W_])(?<!\.)(?:(?<=[\s=:(])[-+])?(?:[0-9]+(?:[.,][0-9]+)?|[.,][0-9]+)(?:[eE][-+]?[0-9]+)?)"
    r"|(?P<word>[A-Za-z]+|[^\W_0-9A-Za-z]+)|(?P<sign>[%\u2030])|(?P<digits>[0-9]+)"
)
_UNIT_WORD = re.compile(
    r"(?i)(?:1/(?:nm|cm|angstroms?|a)\b|(?:nm|cm|angstrom|a)\^?-1\b)"
)  # fmt: skip
# words that are a unit wherever they stand, and those that are one behind a name
_ALWAYS = "deg rad mrad nm um angstrom eV keV THz percent permille"
_STRONG_UNITS = frozenset(_ALWAYS.split())
UNITS_BEHIND_WORDS = _STRONG_UNITS | {"cm-1", "mm", "1/angstrom", "1/nm"}


def cased(word: str) -> list[str]:
    """Return a word taken apart where small letters end and capitals begin: angleOfIncidence."""
    if word.isupper() or not (word.isascii() and word.isalpha()):
        return [word]
    return re.findall(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])", word) or [word]


def words_of(text: str) -> Words:
    """Return what a comment, a setting or a file name says, word by word."""
    concepts: set[str] = set()
    numbers: list[tuple[float, str]] = []
    units: set[str] = set()
    unknown, capitals = False, []
    text = spelled(text)
    for unit in {unit_of(match) or "" for match in _UNIT_WORD.findall(text)}:
        units.add(unit)
    text = _UNIT_WORD.sub(" ", text)
    end, last = -9, None
    for match in _WORD.finditer(text):
        if match.lastgroup == "number":
            numbers.append((float(match[0].replace(",", ".")), ""))
            end = match.end()
            continue
        if match.lastgroup == "digits":  # AOI60, lambda532; but not "sample2"
            if last in ("incidence", "angle", "grazing", "wavelength", "laser"):
                numbers.append((float(match[0]), ""))
                end = match.end()
            else:
                unknown = True
            continue
        whole = match[0]
        unit = UNITS.get(whole.lower())
        behind = numbers and not text[end : match.start()].strip(" _\t:,;=([{") and end > 0
        if unit in _STRONG_UNITS or (behind and unit == "angstrom"):
            if behind and not numbers[-1][1]:
                numbers[-1] = (numbers[-1][0], unit or "")
                end = -9
            elif whole != "a":
                units.add(unit or "")
            capitals.append(whole)
            continue
        for word in cased(whole):
            capitals.append(word)
            found = last = CONCEPT.get(word.lower())
            if word in ("R", "T"):
                found = word
            elif unit in ("permille", "1", "arb") and found is None:
                units.add(unit)
                continue
            if found is None:
                unknown = True
                concepts |= {c for root, c in _ROOTS.items() if root in word.lower()}
            else:
                concepts.add(found)
    return Words(concepts - {""}, numbers, units - {""}, unknown, capitals)
