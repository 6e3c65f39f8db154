"""Measurements drawn at random over all that users have: angles, quantity, noise, media, materials.

A geometry is drawn as a whole (angles, polarization, index of the medium outside), then a batch of
materials of every class with noise of their own. All geometries of one quantity share one compiled
program: curves are filled up to `MOST_ANGLES` with gaps.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from tests.truth.textbook import reflectances

MOST_ANGLES = 60
CURVES_OF_A_CLASS = 200
QUANTITIES = {"s, p": ("R_s", "R_p"), "p": ("R_p",), "unpolarized": ("R",), "s": ("R_s",)}
CLASSES = ("dielectric", "weak absorber", "semiconductor", "metal", "total reflection")
# Bins of the lowest angle, degrees, by which cells are told apart.
LOWEST_BINS = (0.0, 25.0, 50.0, 75.0)
LOWEST, HIGHEST, LEAST_SPAN = 75.0, 89.0, 5.0


class Geometry(NamedTuple):
    """angles: (M,) degrees, rising. quantity: key of QUANTITIES. eta_i: medium outside."""

    angles: np.ndarray
    quantity: str
    eta_i: float

    @property
    def padded_angles(self) -> np.ndarray:
        """The angles (MOST_ANGLES,), the last one repeated."""
        return np.pad(self.angles, (0, MOST_ANGLES - len(self.angles)), mode="edge")

    @property
    def angle_bin(self) -> str:
        """The bin of the lowest angle."""
        i = int(np.searchsorted(LOWEST_BINS[1:-1], self.angles[0], side="right"))
        return f"{LOWEST_BINS[i]:g} to {LOWEST_BINS[i + 1]:g}"


def with_gaps(of: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Return arrays (N, M) filled up to (N, MOST_ANGLES) with NaN."""
    return {
        name: np.pad(v, ((0, 0), (0, MOST_ANGLES - v.shape[1])), constant_values=np.nan)
        for name, v in of.items()
    }


class Batch(NamedTuple):
    """Curves of one geometry: true absolute index, class and noise (N,), data by channel (N, M)."""

    geometry: Geometry
    eta: np.ndarray
    k: np.ndarray
    kind: np.ndarray
    noise: np.ndarray
    data: dict[str, np.ndarray]

    def padded(self) -> tuple[np.ndarray, dict[str, Any]]:
        """Return angles (MOST_ANGLES,) and data with gaps after the last angle."""
        return self.geometry.padded_angles, with_gaps(self.data)

    def take(self, pick: np.ndarray) -> Batch:
        """Return the curves of ``pick``."""
        return Batch(
            self.geometry, self.eta[pick], self.k[pick], self.kind[pick], self.noise[pick],
            {name: v[pick] for name, v in self.data.items()},
        )  # fmt: skip


def draw_geometry(rng: np.random.Generator, quantity: str | None = None) -> Geometry:
    """Return 5 to 60 angles, lowest 0 to 75 degrees, highest to 89, equidistant or not."""
    low = rng.uniform(0.0, LOWEST)
    high = rng.uniform(low + LEAST_SPAN, HIGHEST)
    count = int(rng.integers(5, MOST_ANGLES + 1))
    angles = np.linspace(low, high, count)
    if rng.random() < 0.5:
        angles[1:-1] = np.sort(rng.uniform(low, high, count - 2))
    eta_i = 1.0 if rng.random() < 0.5 else float(rng.uniform(1.0, 2.4))
    return Geometry(angles, quantity or str(rng.choice(list(QUANTITIES))), eta_i)


def draw_index(
    kind: str, count: int, eta_i: float, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Return random absolute eta and k of a class of materials, (count,) each."""
    if kind == "dielectric":
        return rng.uniform(1.3, 3.5, count), np.zeros(count)
    if kind == "weak absorber":
        return rng.uniform(1.3, 3.5, count), 10.0 ** rng.uniform(-6.0, np.log10(0.3), count)
    if kind == "semiconductor":
        return rng.uniform(2.0, 5.0, count), rng.uniform(0.01, 3.0, count)
    if kind == "total reflection":  # less than the medium outside
        return eta_i * rng.uniform(0.3, 0.95, count), 10.0 ** rng.uniform(-4.0, 0.0, count)
    return rng.uniform(0.05, 4.0, count), rng.uniform(1.0, 10.0, count)


def textbook(angle_deg: np.ndarray, index: np.ndarray, eta_i: float = 1.0) -> dict[str, np.ndarray]:
    """Return R_s, R_p and R by the complex amplitudes of the textbooks; arguments broadcast."""
    return reflectances(np.cos(np.radians(angle_deg)), index, eta_i)


def draw_noise(count: int, rng: np.random.Generator) -> np.ndarray:
    """Return standard errors (count,): none in one of eight, else 1e-4 to 1e-2."""
    noise = 10.0 ** rng.uniform(-4.0, -2.0, count)
    return np.where(rng.random(count) < 0.125, 0.0, noise)


def draw_batch(geometry: Geometry, count: int, rng: np.random.Generator) -> Batch:
    """Return ``count`` curves of each class."""
    found = [draw_index(kind, count, geometry.eta_i, rng) for kind in CLASSES]
    eta, k = (np.concatenate(part) for part in zip(*found, strict=True))
    noise = draw_noise(len(eta), rng)
    exact = textbook(geometry.angles, (eta + 1j * k)[:, None], geometry.eta_i)
    data = {
        name: exact[name] + noise[:, None] * rng.standard_normal(exact[name].shape)
        for name in QUANTITIES[geometry.quantity]
    }
    return Batch(geometry, eta, k, np.repeat(CLASSES, count), noise, data)


def draw(
    seed: int, number: int, curves: int = CURVES_OF_A_CLASS
) -> tuple[Batch, np.random.Generator]:
    """Return the batch of geometry ``number``, and the generator that made it.

    curves: of each class.
    """
    rng = np.random.default_rng([seed, number])
    quantity = list(QUANTITIES)[number % len(QUANTITIES)]
    return draw_batch(draw_geometry(rng, quantity), curves, rng), rng
