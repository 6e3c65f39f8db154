"""Delta whose sign the instrument does not see, N, C and S, and the MSE of ellipsometers."""

from __future__ import annotations

import io
from typing import Any

import numpy as np
import pytest

from fitting import Fit, Measurement, MeasurementError, fit, fit_many, read_csv, simulate

pytestmark = pytest.mark.slow

ANGLES = np.array([60.0, 65.0, 70.0, 75.0])
SURFACE = {"eta": 2.0, "k": 0.3}
FILM, TRUTH = "air | cauchy:2 60..150 nm | Si", {"A": 1.45, "B": 0.0036, "film.thickness_nm": 100.0}


def surface(*quantities: str) -> Any:
    return {q: simulate("free", SURFACE, ANGLES, None, q) for q in quantities}


def spectrum(noise: float = 0.0) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Return 60 wavelengths and psi and Delta at 65 and 75 degrees of a film of 100 nm."""
    w = np.linspace(0.3, 1.0, 60)
    rng = np.random.default_rng(1)
    return w, {
        f"{name} ({angle:g} deg)": simulate(FILM, TRUTH, np.full(60, angle), w, name)
        + noise * size * rng.normal(size=60)
        for angle in (65.0, 75.0)
        for name, size in (("psi", 0.05), ("delta", 0.1))
    }


def text_of(w: np.ndarray, columns: dict[str, np.ndarray], folded: bool = False) -> str:
    rows = np.array([*columns.values()]).T
    if folded:
        rows[:, 1::2] = np.minimum(rows[:, 1::2] % 360.0, 360.0 - rows[:, 1::2] % 360.0)
    cells = [[f"{1e3 * x:.6g}", *(f"{v:.5f}" for v in row)] for x, row in zip(w, rows, strict=True)]
    lines = [*map(",".join, cells)]
    return "\n".join([",".join(["wavelength (nm)", *columns]), *lines])


def test_a_film_of_100_nm_with_folded_delta() -> None:
    """Delta of a rotating analyzer, compared as if its sign were known, gave 93.7 +- 8 nm."""
    m = read_csv(io.StringIO(text_of(*spectrum(1.0), folded=True)))
    assert set(m.quantity) == {"psi", "delta_folded"} and "unknown sign" in m.understood
    found = fit(m, FILM, starts=16)
    thickness = found.parameters["thickness_nm"]
    assert found.status == "converged" and thickness.sigma < 0.1
    assert abs(thickness.value - 100.0) < 4.0 * thickness.sigma


def test_which_delta_is_folded() -> None:
    w, columns = spectrum(1.0)
    whole = text_of(w, columns)
    assert "delta" in read_csv(io.StringIO(whole)).quantity  # from 60 to 285 degrees
    below = {q: v if "psi" in q else 90.0 + 0.3 * (v - 180.0) for q, v in columns.items()}
    assert "delta" in read_csv(io.StringIO(text_of(w, below))).quantity  # it never turns sharply
    folded = text_of(w, columns, folded=True)
    assert "delta" in read_csv(io.StringIO(folded), delta_range=360).quantity
    by_option, by_itself = (read_csv(io.StringIO(t), **o) for t, o in
                            ((whole, {"delta_range": "180"}), (folded, {})))  # fmt: skip
    assert by_option.value == pytest.approx(by_itself.value, abs=1e-9)
    for bad, wanted in ((90, "180 or 360"), (180, "no column")):
        with pytest.raises(MeasurementError, match=wanted):
            read_csv(io.StringIO("angle,R_s\n10,.1\n20,.2\n"), delta_range=bad)


@pytest.mark.parametrize("names", [
    ("psi", "delta_folded"), pytest.param(("N", "C", "S"), marks=pytest.mark.study)
])  # fmt: skip
def test_one_surface_many_and_several_wavelengths(names: tuple[str, ...]) -> None:
    data = surface(*names)
    one = fit(Measurement.from_columns(ANGLES, None, **data))
    waves = np.repeat([0.5, 0.6], 4)
    each: Any = {q: np.tile(v, 2) for q, v in data.items()}
    several = fit(Measurement.from_columns(np.tile(ANGLES, 2), waves, **each))
    curves: Any = {q: np.stack([v] * 3) for q, v in data.items()}
    many = fit_many(ANGLES, **curves)
    for found, shape in ((one, ()), (several, (2,)), (many, (3,))):
        for name, value in SURFACE.items():
            assert np.shape(found.values[name]) == shape
            assert found.values[name] == pytest.approx(value, rel=1e-9)


def test_predictions_are_folded() -> None:
    at = {q: simulate("air | cauchy:1 100 nm | Si", {"A": 1.46}, ANGLES, 0.45, q)
          for q in ("psi", "delta", "delta_folded", "N", "C", "S")}  # fmt: skip
    delta = at["delta"] % 360.0
    assert delta.max() > 180.0
    assert at["delta_folded"] == pytest.approx(np.minimum(delta, 360.0 - delta), rel=1e-12)
    two_psi, delta = np.radians(2.0 * at["psi"]), np.radians(delta)
    ncs = np.cos(two_psi), np.sin(two_psi) * np.cos(delta), np.sin(two_psi) * np.sin(delta)
    for name, wanted in zip("NCS", ncs, strict=True):
        assert at[name] == pytest.approx(wanted, abs=1e-13)


def test_mean_squared_error() -> None:
    """By its definition, from psi and Delta and from N, C and S."""
    bend = 1e-3 * np.cos(np.arange(4.0) ** 2)
    noisy: Any = {q: v + bend for q, v in surface("N", "C", "S").items()}
    every: list[tuple[Fit, float]] = []
    m = Measurement.from_columns(ANGLES, None, **noisy)
    found = fit(m)
    off = np.split(m.value - found.predict().value, 3)
    every.append((found, float(np.square(off).sum())))
    angles = surface("psi", "delta")
    angles["psi"] = angles["psi"] + [0.01, -0.02, 0.01, 0.02]
    m = Measurement.from_columns(ANGLES, None, **angles)
    found = fit(m)
    pair = m.value, found.predict().value
    measured, fitted = (
        np.array([np.cos(2 * p), np.sin(2 * p) * np.cos(d), np.sin(2 * p) * np.sin(d)])
        for p, d in (np.radians(np.split(v, 2)) for v in pair)
    )
    every.append((found, float(np.square(measured - fitted).sum())))
    for found, squares in every:
        mse = 1e3 * np.sqrt(squares / (3 * 4 - 2))
        assert found.mse == pytest.approx(mse, rel=1e-9) and found.to_dict()["mse"] == found.mse
        assert f"MSE          {mse:.3g}" in str(found)
    each = {q: np.stack([v, v]) for q, v in angles.items()}
    assert fit_many(ANGLES, **each).mse == pytest.approx([found.mse] * 2, rel=1e-6)
    assert "MSE" not in str(fit(Measurement.from_columns(ANGLES, None, **surface("R_s", "R_p"))))


def test_n_c_s_in_files() -> None:
    text = "angle,N,C,S,sigma_N,sigma_C,sigma_S\n60,.1,.2,.9,.01,.01,.01\n70,.1,.2,.8,.01,.01,.01\n"
    m = read_csv(io.StringIO(text))
    assert [*dict.fromkeys(m.quantity.tolist())] == ["N", "C", "S"] and np.isfinite(m.sigma).all()
    with pytest.raises(MeasurementError, match="column S: this column"):  # a letter alone
        read_csv(io.StringIO("angle,R_s,S\n60,.1,.2\n70,.1,.3\n"))
