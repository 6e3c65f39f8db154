"""What a model fit refuses: names, values and quantities that do not go together."""

import re

import numpy as np
import pytest

from fitting import Measurement, Sample, choose, fit, simulate
from fitting.samples.parameters import names_of, parse_setting, settings_of


@pytest.mark.parametrize(("options", "words"), [
    ({"sample": "coshy"}, "'coshy' is not an index"),
    ({"sample": "cauchy:9"}, "takes 1 to 8 terms"),
    ({"sample": "drude:2"}, "takes no number of terms"),
    ({"sample": "film"}, "'film' is not an index"),
    ({"sample": "air | cauchy | air"}, "the layer 'cauchy' has no thickness"),
    ({"sample": "air | cauchy -1 um thick | air"}, "a thickness from 1e-6 to 1e9 um"),
    ({"sample": "air | cauchy 50-500 nm | Si"}, "with a range 'SiO2 100..150 nm'"),
    ({"sample": "air | cauchy 50 to 500 nm | Si"}, "a range of thickness is written with two dots"),
    ({"sample": "air | caushy 50 nm | Si"}, "a similar name is 'cauchy'"),
    ({"sample": "air | Tauc Lorentz 50 nm | Si"}, "a similar name is 'tauc-lorentz'"),
    ({"sample": "air | 1,45 50 nm | Si"}, "numbers are written with a decimal point"),
    ({"sample": "air / cauchy 50 nm / Si"}, r"media are separated by \|"),
    ({"sample": "air | cauchy 0 um thick | air"}, "a thickness from 1e-6 to 1e9 um"),
    ({"sample": "air | cauchy 1 um stiff | air"}, "'stiff' came after the thickness"),
    ({"sample": "air | cauchy 3..2 mm thick | air"}, "the smaller thickness of a range"),
    ({"sample": "cauchy 3 mm"}, "takes no thickness; a plate in air"),
    ({"sample": "gold | cauchy"}, "the first medium, 'gold', which must be known and lossless"),
    ({"sample": "auto"}, "leaves its dispersion model open"),
    ({"free": ["scal"]}, "has no parameter 'scal'"),
    ({"free": "scal"}, "has no parameter 'scal'"),
    ({"fixed": {"A": float("nan")}}, "A is fixed at nan"),
    ({"fixed": {"A": 1.5}, "bounds": {"A": (1, 2)}}, "A is fixed and cannot also be"),
    ({"fixed": {"A": 1.5, "B": 0.0, "C": 0.0}}, "is known, fixed or tied"),
    ({"bounds": {"A": (2, 1)}}, "the lower end must come first"),
    ({"priors": {"A": (1.5, 0.0)}}, "above 0"),
    ({"tie": {"A": "x y * 3"}}, "the name of another parameter was wanted"),
    ({"tie": {"A": "D"}}, "has no parameter 'D'"),
    ({"tie": {"A": "B"}, "fixed": {"A": 1.5}}, "A is tied to another parameter"),
    ({"tie": {"A": "B", "B": "C"}}, "A is tied to B, which is tied itself"),
    ({"loss": "cubes"}, "loss is 'cubes'"),
    ({"sample": "-1 | cauchy"}, "'-1' is not an index"),
    ({"starts": 0}, "starts is 0"),
    ({"sample": "1+1i | cauchy"}, "lossless: a real number above 0"),
    ({"start": {"D": 1.0}}, "start names D"),
    ({"sample": "constant", "start": {"eta": -1.0}}, "the start of eta is -1; a number from"),
    ({"sample": "constant", "start": {"eta": float("nan")}}, "the start of eta is nan"),
    ({"sample": "constant", "bounds": {"eta": (1, 2)}, "start": {"eta": 3}}, "from 1 to 2 was"),
    ({"sample": "drude", "bounds": {"width_ev": (0, 1)}, "start": {"width_ev": 0}}, "above 0 to 1"),
    ({"errors": "none"}, "errors is 'none'"),
    ({"fixed": ["A"]}, r"fixed is \['A'\]; a mapping"),
    ({"bounds": [("A", (1, 2))]}, "bounds is .*; a mapping"),
    ({"tie": "A"}, "tie is 'A'; a mapping"),
    ({"free": 3}, "free is 3; the name of a parameter"),
    ({"start": [1.5, 0.1]}, r"start is \[1.5, 0.1\]; a mapping from names"),
    ({"seed": "a"}, "seed is 'a'; a whole number"),
    ({"starts": True}, "starts is True"),
    # Once k = -0.3, which fits as well.
    ({"sample": "constant", "tie": {"k": "-0.2 * eta"}}, "a factor above 0 was wanted"),
    ({"tie": {"A": (float("nan"), "B")}}, "the name of another parameter was wanted"),
])  # fmt: skip
def test_refusals(options, words):
    m = Measurement.from_columns([45.0, 60.0], 0.5, R_s=[0.1, 0.2], R_p=[0.02, 0.01])
    with pytest.raises(ValueError, match=words):
        fit(m, **{"sample": "cauchy", **options})


def test_transmittance_is_not_that_of_one_surface():
    """Of a plate of index 1.5 it is that of one surface of 1.77, whose A had an error of 2e-8."""
    wave = np.linspace(0.4, 0.8, 9)
    plate = {"A": 1.5, "B": 0.005}
    m = Measurement.from_columns(
        0.0, wave, T=simulate("air | cauchy:2 1 mm thick | air", plate, 0.0, wave, "T")
    )
    with pytest.raises(ValueError, match=r"one bare surface.* 'air \| cauchy 3 mm thick \| air'"):
        fit(m, "cauchy")
    with pytest.raises(ValueError, match=r"'air \| auto 3 mm thick \| air'"):
        choose(m)


@pytest.mark.parametrize("layer", ["cauchy 60 um", "cauchy 60 um graded", "SiO2 60..70 um graded"])
def test_what_is_advised_for_unseen_fringes_can_be_written(layer):
    """A graded layer was to be written 'graded thick', which exclude each other."""
    m = Measurement.from_columns(0.0, np.linspace(0.4, 0.8, 9), R=np.full(9, 0.1))
    with pytest.raises(ValueError, match="fringes would lie between") as refused:
        fit(m, f"air | {layer} | Si")
    advised = re.search(r"Write '(.*?)'", str(refused.value))
    assert advised and not Sample.parse(f"air | {advised[1]} | Si").films


def test_refusals_of_data():
    angle = [45.0, 60.0]
    unknown = Measurement.from_columns(angle, R_s=[0.1, 0.2])
    with pytest.raises(ValueError, match="wavelength"):
        fit(unknown, "cauchy")
    ellipsometry = Measurement.from_columns(angle, 0.5, psi=[20.0, 10.0], delta=[0.0, 0.0])
    with pytest.raises(ValueError, match="scale acts on powers"):
        fit(ellipsometry, "constant", free=["scale"])
    with pytest.raises(
        ValueError,
        match='errors "stated" need a standard error for every datum, and 4 of 4 have none',
    ):
        fit(ellipsometry, "constant", errors="stated")
    with pytest.raises(ValueError, match="have no psi"):
        fit(Measurement.from_columns(angle, 0.5, delta=[0.0, 0.0]), "constant")


@pytest.mark.parametrize(("text", "meaning"), [
    ("eta=1.5", ("eta", "fixed", 1.5)),
    (" angle-offset = -0.25 ", ("angle_offset", "fixed", -0.25)),
    ("k=0.1..2", ("k", "bounds", (0.1, 2.0))),
    ("k=..2", ("k", "bounds", (-float("inf"), 2.0))),
    ("k=1e-3..", ("k", "bounds", (1e-3, float("inf")))),
    ("film.thickness_nm=400..440", ("film.thickness_nm", "bounds", (400.0, 440.0))),
    ("film_2.k = 1e-3", ("film_2.k", "fixed", 1e-3)),
    ("scale~1+-0.02", ("scale", "priors", (1.0, 0.02))),
    ("scale[s-file.csv R_s]=1 +- .02", ("scale[s-file.csv R_s]", "priors", (1.0, 0.02))),
])  # fmt: skip
def test_settings_as_text(text, meaning):
    assert parse_setting(text) == meaning


@pytest.mark.parametrize("text", ["eta", "eta=", "=1", "eta=1.5.2", "k=..", "k~2", "k=1+-", "1=2"])
def test_texts_that_say_nothing(text):
    with pytest.raises(ValueError, match="NAME=VALUE"):
        parse_setting(text)


def test_settings_together():
    found = settings_of("angle-offset", {"eta": 1.5}, {"k": (0, 1)}, {"scale": (1, 0.1)})
    assert found.names == ("angle_offset", "eta", "k", "scale")
    assert names_of(n for n in ("scale", "leak")) == ("scale", "leak")
    with pytest.raises(ValueError, match="eta is fixed and cannot also be free"):
        settings_of(fixed={"eta": 1.5}, bounds={"eta": (1.0, 2.0)})
