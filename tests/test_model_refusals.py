"""What a model fit refuses: names, values and quantities that do not go together."""

import pytest

from fitting import Measurement, fit_model
from fitting.model.parameters import Settings, check_settings, names_of, parse_setting


@pytest.mark.parametrize(("options", "words"), [
    ({"model": "coshy"}, "there is no model 'coshy'"),
    ({"model": "cauchy:9"}, "takes 1 to 8 terms"),
    ({"model": "drude:2"}, "takes no number of terms"),
    ({"structure": "film"}, "structure is 'film'"),
    ({"structure": "slab"}, "a slab needs its thickness"),
    ({"structure": "slab", "thickness_um": -1.0}, "number above 0"),
    ({"free": ["scal"]}, "has no parameter 'scal'"),
    ({"free": "scal"}, "has no parameter 'scal'"),
    ({"fixed": {"A": float("nan")}}, "A is held at nan"),
    ({"fixed": {"A": 1.5}, "bounds": {"A": (1, 2)}}, "at once"),
    ({"fixed": {"A": 1.5, "B": 0.0, "C": 0.0}}, "every parameter is held"),
    ({"bounds": {"A": (2, 1)}}, "the lower end first"),
    ({"priors": {"A": (1.5, 0.0)}}, "above 0"),
    ({"loss": "cubes"}, "loss is 'cubes'"),
    ({"eta_i": -1.0}, "eta_i is -1.0"),
    ({"starts": 0}, "starts is 0"),
    ({"eta_i": 1.0 + 1.0j}, "eta_i is "),
    ({"start": {"D": 1.0}}, "start names D"),
    ({"model": "constant", "start": {"eta": -1.0}}, "the start of eta is -1; a number from"),
    ({"model": "constant", "start": {"eta": float("nan")}}, "the start of eta is nan"),
    ({"model": "constant", "bounds": {"eta": (1, 2)}, "start": {"eta": 3}}, "from 1 to 2 was"),
    ({"model": "drude", "bounds": {"width_ev": (0, 1)}, "start": {"width_ev": 0}}, "above 0 to 1"),
    ({"sigma": "none"}, "sigma is 'none'"),
])  # fmt: skip
def test_refusals(options, words):
    m = Measurement.from_columns([45.0, 60.0], 0.5, R_s=[0.1, 0.2], R_p=[0.02, 0.01])
    with pytest.raises(ValueError, match=words):
        fit_model(m, **options)


def test_refusals_of_data():
    angle = [45.0, 60.0]
    unknown = Measurement.from_columns(angle, R_s=[0.1, 0.2])
    with pytest.raises(ValueError, match="wavelength"):
        fit_model(unknown, "cauchy")
    ellipsometry = Measurement.from_columns(angle, 0.5, psi=[20.0, 10.0], delta=[0.0, 0.0])
    with pytest.raises(ValueError, match="no definite phase"):
        fit_model(ellipsometry, "cauchy", "slab", thickness_um=100.0)
    with pytest.raises(ValueError, match="scale acts on powers"):
        fit_model(ellipsometry, "constant", free=["scale"])
    with pytest.raises(ValueError, match="absolute_sigma"):
        fit_model(ellipsometry, "constant", absolute_sigma=True)
    with pytest.raises(ValueError, match="have no psi"):
        fit_model(Measurement.from_columns(angle, 0.5, delta=[0.0, 0.0]), "constant")


@pytest.mark.parametrize(("text", "meaning"), [
    ("eta=1.5", ("eta", "fixed", 1.5)),
    (" angle-offset = -0.25 ", ("angle_offset", "fixed", -0.25)),
    ("k=0.1..2", ("k", "bounds", (0.1, 2.0))),
    ("k=..2", ("k", "bounds", (-float("inf"), 2.0))),
    ("k=1e-3..", ("k", "bounds", (1e-3, float("inf")))),
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
    found = check_settings(
        Settings(names_of("angle-offset"), {"eta": 1.5}, {"k": (0, 1)}, {"scale": (1, 0.1)})
    )
    assert found.names == ("angle_offset", "eta", "k", "scale")
    assert names_of(n for n in ("scale", "leak")) == ("scale", "leak")
    with pytest.raises(ValueError, match="at once"):
        check_settings(Settings(fixed={"eta": 1.5}, bounds={"eta": (1.0, 2.0)}))
