"""The simulated scan of the README: germanium at 632.8 nm, with a known truth and honest errors.

`python examples/simulated_scan.py` writes examples/data/germanium_633nm_simulated.csv: R_s and R_p
at 14 angles, with normal noise of the standard errors in the file. A fit of it must give back the
index of `fresnel_jax.dispersion.material("germanium")` within its errors, with a reduced chi2 near
1.
"""

from pathlib import Path

import jax
import numpy as np

from fresnel_jax import powers
from fresnel_jax.dispersion import material

jax.config.update("jax_enable_x64", True)

FILE = Path(__file__).resolve().parent / "data" / "germanium_633nm_simulated.csv"
WAVELENGTH_UM, SEED = 0.6328, 5
HEADER = """\
# title: Reflectance of germanium at 632.8 nm, s and p polarized: a simulation, not a measurement
# made by: python examples/simulated_scan.py
# truth: eta {eta:.4f}, k {k:.4f} ({source})
# noise: normal, of the standard errors that are stated: 0.4 % of the value and 0.001
angle_deg,R_s,sigma_R_s,R_p,sigma_R_p
"""


def truth() -> tuple[float, float]:
    """eta and k of germanium."""
    eta, k = material("germanium")(WAVELENGTH_UM)
    return float(eta), float(k)


def text() -> str:
    """The file's text."""
    random = np.random.default_rng(SEED)
    angle_deg = np.arange(20.0, 86.0, 5.0)
    exact = powers(np.cos(np.deg2rad(angle_deg)), *truth())
    columns = [angle_deg]
    for R in map(np.asarray, (exact.R_s, exact.R_p)):
        sigma = np.hypot(0.004 * R, 0.001)
        columns += [R + sigma * random.standard_normal(R.shape), sigma]
    eta, k = truth()
    rows = (
        "{:.0f},{:.5f},{:.5f},{:.5f},{:.5f}\n".format(*row) for row in zip(*columns, strict=True)
    )
    return HEADER.format(eta=eta, k=k, source="fresnel_jax.materials") + "".join(rows)


if __name__ == "__main__":
    FILE.write_text(text(), encoding="utf-8")
    print(f"wrote {FILE}")
