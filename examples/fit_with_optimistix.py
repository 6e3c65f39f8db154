"""Your own loss: eta and k of measured curves with optimistix.least_squares on fresnel_jax.powers.

The residuals are (R(eta, k) - data) / sigma. What to take for the unknowns decides whether the fit
works, since for light from a lossless medium R is even in k: dR/dk = 0 at k = 0. There a fit in k,
log k or softplus(k) stands still, whatever the data say, and glass lies exactly there. R is smooth
in u = k^2, so the unknowns here are

    p = (log eta, k^2),       R(u) = 2 R(0) - R(-u)  for u < 0,

R continued beyond k = 0 as a point reflection. A best u below 0 means k = 0: then eta is fitted
alone. (With light from a denser medium, beyond the critical angle, R is not even in k.)

`main` fits the gold scan in examples/data three ways (the index alone; with an unknown scale and
angle offset, whose priors are further residuals; and `fitting.fit`), gives the covariance from the
Jacobian at the solution, and counts over simulated curves how often other unknowns and other starts
miss the best fit.
"""

from functools import partial
from pathlib import Path
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
from _optimistix_picture import draw
from _picture import arguments
from jaxtyping import Array

from fitting import fit, read_csv
from fresnel_jax import powers

jax.config.update("jax_enable_x64", True)

GOLD = Path(__file__).resolve().parent / "data" / "gold_532nm.csv"
# Stops where a step would change parameters and cost by less than one part in 1e8.
SOLVER = optx.LevenbergMarquardt(rtol=1e-8, atol=1e-8)
ANGLES = np.linspace(0.0, 90.0, 181)
SCALE_SIGMA, OFFSET_SIGMA_DEG = 0.05, 0.5  # what was known of the bench before


class Data(NamedTuple):
    """Measured values, each array (N,); share_s is 1 for R_s, 0 for R_p, .5 for unpolarized R."""

    angle_deg: Array
    share_s: Array
    value: Array
    sigma: Array


def curve(eta, k, angle_deg, share_s):
    """R of light of which the share `share_s` is s-polarized."""
    R = powers(jnp.cos(jnp.deg2rad(angle_deg)), eta, k)
    return share_s * R.R_s + (1.0 - share_s) * R.R_p


def continued(eta, u, angle_deg, share_s):
    """R at k^2 = u, for u < 0 continued with the slope that it has at 0."""
    # 1e-16 keeps sqrt differentiable at 0 and changes R by less than its rounding error.
    k = jnp.sqrt(jnp.where(u < 0.0, -u, u) + 1e-16)
    R, R_0 = curve(eta, k, angle_deg, share_s), curve(eta, 0.0, angle_deg, share_s)
    return jnp.where(u < 0.0, 2.0 * R_0 - R, R)


def residuals(p, args):
    """Of p = (log eta, k^2), in standard errors; `absorbs` 0 holds k at 0."""
    data, absorbs = args
    R = continued(jnp.exp(p[0]), absorbs * p[1], data.angle_deg, data.share_s)
    return (R - data.value) / data.sigma


def with_instrument(p, angle_deg, share_s):
    """What the bench shows, for p = (log eta, k^2, scale, angle offset in degrees)."""
    return p[2] * continued(jnp.exp(p[0]), p[1], angle_deg + p[3], share_s)


def residuals_with_instrument(p, data: Data):
    """Of the same p: what was known of scale and offset before is two more residuals."""
    R = with_instrument(p, data.angle_deg, data.share_s)
    prior = jnp.array([(p[2] - 1.0) / SCALE_SIGMA, p[3] / OFFSET_SIGMA_DEG])
    return jnp.append((R - data.value) / data.sigma, prior)


def starts(data: Data):
    """(log eta, k^2) of the best eta at each of 10 k, the best of all first, (10, 2)."""
    eta, k = jnp.geomspace(0.05, 6.0, 30), jnp.geomspace(0.02, 12.0, 10)[:, None]
    R = curve(eta[..., None], k[..., None], data.angle_deg, data.share_s)
    chi2 = jnp.sum(((R - data.value) / data.sigma) ** 2, axis=-1)
    best = jnp.argmin(chi2, axis=1)
    order = jnp.argsort(jnp.min(chi2, axis=1))
    return jnp.stack([jnp.log(eta[best]), k[:, 0] ** 2], axis=-1)[order]


def minimum(function, p, data):
    """(p, whether it converged, steps) of the least squares of `function(p, data)`."""
    found = optx.least_squares(function, SOLVER, p, args=data, max_steps=256, throw=False)
    return found.value, found.result == optx.RESULTS.successful, found.stats["num_steps"]


class Solution(NamedTuple):
    """eta, k, chi^2, whether the solver converged and in how many steps; (B,) under vmap."""

    eta: Array
    k: Array
    chi2: Array
    converged: Array
    steps: Array


@jax.jit
def fit_from(p, data: Data) -> Solution:
    """The least squares of eta and k >= 0 from starts (log eta, k^2), (S, 2): the best of them."""
    # Every start once with k free and once with k = 0, as lanes of one program: the second ones are
    # the answer where the best k^2 is below 0.
    p, absorbs = jnp.concatenate([p, p]), jnp.repeat(jnp.array([1.0, 0.0]), len(p))
    p, converged, steps = jax.vmap(lambda p, a: minimum(residuals, p, (data, a)))(p, absorbs)
    chi2 = jax.vmap(lambda p, a: jnp.sum(residuals(p, (data, a)) ** 2))(p, absorbs)
    u = absorbs * p[:, 1]
    best = jnp.argmin(jnp.where(u < 0.0, jnp.inf, chi2))
    return Solution(
        jnp.exp(p[best, 0]), jnp.sqrt(u[best]), chi2[best], converged[best], steps[best]
    )


def fit_index(data: Data) -> Solution:
    """The least squares of eta and k of one curve."""
    return fit_from(starts(data), data)


# Of many curves with equally many values, all arrays (B, N): one compiled program.
starts_of_many = jax.jit(jax.vmap(starts))
fit_many_indices = jax.jit(jax.vmap(fit_index))


@jax.jit
def fit_with_instrument(data: Data):
    """(p, its covariance, chi^2) with an unknown scale and angle offset."""
    p, _, _ = minimum(
        residuals_with_instrument, jnp.append(starts(data)[0], jnp.array([1.0, 0.0])), data
    )
    J = jax.jacfwd(residuals_with_instrument)(p, data)
    r = residuals_with_instrument(p, data)
    return p, jnp.linalg.inv(J.T @ J), r @ r


def standard_errors(eta, k, data: Data):
    """Of eta and k, where k > 0: the Jacobian in (eta, k) itself, at the solution."""
    J = jax.jacfwd(lambda x: curve(*x, data.angle_deg, data.share_s) / data.sigma)(
        jnp.array([eta, k])
    )
    return jnp.sqrt(jnp.diagonal(jnp.linalg.inv(J.T @ J)))


def gold() -> Data:
    """The measured scan of gold at 532 nm, s and p."""
    m = read_csv(GOLD)
    share_s = np.where(m.quantity == "R_s", 1.0, 0.0)
    return Data(*map(jnp.asarray, (m.angle_deg, share_s, m.value, m.sigma)))


OURS = "log eta, k^2"
# The share of s-polarized light in each of 40 values
KINDS = {"R_s and R_p": np.arange(40) % 2.0, "R": np.full(40, 0.5), "R_p": np.zeros(40)}
# What else people fit: eta and k from the unknowns, and the unknowns from eta and k.
UNKNOWNS = {
    "eta, k": (lambda p: p, lambda x: x),
    "log eta, log k": (jnp.exp, jnp.log),
    "softplus": (lambda p: jnp.log1p(jnp.exp(p)), lambda x: jnp.log(jnp.expm1(x))),
}


@partial(jax.jit, static_argnums=0)
def study_fit(name: str, data: Data, eta, k) -> Solution:
    """Fits of many curves in the unknowns of that name, each from its eta and k, (B,)."""

    def one(data, eta, k):
        if name == OURS:
            return fit_from(jnp.stack([jnp.log(eta), k**2])[None], data)
        back, into = UNKNOWNS[name]

        def other(p, data):
            return (curve(*back(p), data.angle_deg, data.share_s) - data.value) / data.sigma

        p, converged, steps = minimum(other, into(jnp.stack([eta, k])), data)
        eta, k = back(p)
        return Solution(eta, jnp.abs(k), jnp.sum(other(p, data) ** 2), converged, steps)

    return jax.vmap(one)(data, eta, k)


def simulated(kind: str, size: int, random: np.random.Generator) -> Data:
    """Curves of 40 values over a random range of angles, with random materials and noise.

    A quarter each are dielectrics (eta 1.3 to 3.5, k = 0), weak absorbers (the same, k 1e-6 to
    1e-2), semiconductors (2 to 5, .01 to 3) and metals (.05 to 4, 1 to 10); noise .0005 to .005.
    """

    def draws(low, high, n):
        return np.exp(random.uniform(np.log(low), np.log(high), n))

    n = size // 4
    eta = np.concatenate([random.uniform(1.3, 3.5, 2 * n), random.uniform(2.0, 5.0, n),
                          draws(0.05, 4.0, n)])  # fmt: skip
    k = np.concatenate(
        [np.zeros(n), draws(1e-6, 1e-2, n), draws(0.01, 3.0, n), draws(1.0, 10.0, n)]
    )
    low = random.uniform(1.0, 60.0, (4 * n, 1))
    high = random.uniform(low + 20.0, 89.0)
    share_s = np.broadcast_to(KINDS[kind], (4 * n, 40))
    angle = low + (high - low) * np.linspace(0.0, 1.0, 40)
    sigma = np.broadcast_to(draws(5e-4, 5e-3, (4 * n, 1)), angle.shape)
    R = np.asarray(curve(eta[:, None], k[:, None], angle, share_s))
    return Data(angle, share_s, R + sigma * random.standard_normal(R.shape), sigma)


class Count(NamedTuple):
    """Of one kind of data, unknowns and start: share that is not the best fit known; steps."""

    kind: str
    unknowns: str
    start: str
    missed: float
    steps: float


def study(size: int) -> list[Count]:
    """How often fits in other unknowns and from other starts miss the best fit."""
    random, counts = np.random.default_rng(17), []
    for kind in KINDS:
        data = simulated(kind, size, random)
        mesh = starts_of_many(data)[:, 0]
        at = {"1.5 + 0 i": (1.5, 0.0), "1.5 + 0.5 i": (1.5, 0.5),
              "mesh": (jnp.exp(mesh[:, 0]), jnp.sqrt(mesh[:, 1]))}  # fmt: skip
        found = {(OURS, "ten of the mesh"): fit_many_indices(data)}
        for where, (eta, k) in at.items():
            eta, k = (jnp.broadcast_to(x, mesh[:, 0].shape) for x in (eta, k))
            for name in (OURS, *UNKNOWNS):
                # log k and softplus cannot start at 0
                if where != "1.5 + 0 i" or name in (OURS, "eta, k"):
                    found[name, where] = study_fit(name, data, eta, k)
        best = np.nanmin(np.stack([x.chi2 for x in found.values()]), axis=0)
        for which, solution in found.items():
            missed = ~(np.asarray(solution.chi2) < best + 0.01)
            counts.append(Count(kind, *which, float(np.mean(missed)),
                                float(np.median(solution.steps))))  # fmt: skip
    return counts


def main(argv=None) -> dict[str, float]:
    """Draws the picture, prints and returns the numbers."""
    picture, size = arguments(
        __doc__, "fit_with_optimistix.png", 400, "simulated curves of each kind", argv
    )
    data = gold()
    plain = fit_index(data)
    scatter = np.sqrt(plain.chi2 / (len(data.value) - 2))
    sigma = scatter * standard_errors(plain.eta, plain.k, data)
    p, covariance, chi2 = fit_with_instrument(data)
    package = fit(read_csv(GOLD))
    sigma_p = np.sqrt(np.diagonal(covariance))
    results = {
        "eta": float(plain.eta), "k": float(plain.k), "sigma_eta": float(sigma[0]),
        "sigma_k": float(sigma[1]), "chi2_reduced": float(scatter**2),
        "fit_eta": package.eta, "fit_k": package.k,
        "fit_sigma_eta": package.parameters["eta"].sigma,
        "scale": float(p[2]), "offset_deg": float(p[3]),
        "chi2_reduced_with_instrument": float(chi2) / (len(data.value) - 2),
    }  # fmt: skip
    print(
        "optimistix   eta {eta:.5f} +- {sigma_eta:.5f}, k {k:.5f} +- {sigma_k:.5f}, chi2/dof "
        "{chi2_reduced:.1f}\nfitting.fit  eta {fit_eta:.5f} +- {fit_sigma_eta:.5f}, k {fit_k:.5f}\n"
        "with scale and angle offset: chi2/dof {chi2_reduced_with_instrument:.1f}".format(**results)
    )
    for name, value, error in zip(("log eta", "k^2", "scale", "offset"), p, sigma_p, strict=True):
        print(f"  {name:8} {value:8.4f} +- {error:.4f}, stated errors taken as they are")
    counts = study(size)
    for x in counts:
        print(f"{x.kind:12} {x.unknowns:15} from {x.start:16} {100.0 * x.missed:5.1f} % miss the "
              f"best fit, median of steps {x.steps:.0f}")  # fmt: skip
    lines = {share: (curve(plain.eta, plain.k, ANGLES, share), with_instrument(p, ANGLES, share))
             for share in (1.0, 0.0)}  # fmt: skip
    draw(picture, data, lines, counts)
    return results | {"counts": counts}


if __name__ == "__main__":
    main()
