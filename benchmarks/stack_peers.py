"""Other people's packages on stacks: `powers(index, thickness_um, angles, wavelengths_um)`.

Each gives R_s, R_p, T_s, T_p of shape (angles, wavelengths) for angles in radians; indices do not
depend on the wavelength. `share` is the part of the points that the benchmark asks for: packages
that compute one point a call would take minutes.
"""

import numpy as np


class TmmStack:
    package, share = "tmm", 0.005

    def __init__(self):
        import tmm

        self._solve = tmm.coh_tmm

    def powers(self, index, thickness_um, angles, wavelengths_um):
        depths = [np.inf, *thickness_um, np.inf]
        out = np.full((4, len(angles), len(wavelengths_um)), np.nan)
        for i, angle in enumerate(angles):
            for j, wavelength in enumerate(wavelengths_um):
                for p, name in enumerate("sp"):
                    found = self._solve(name, list(index), depths, angle, wavelength)
                    out[p, i, j], out[p + 2, i, j] = found["R"], found["T"]
        return out


class TmmFastStack:
    package, share = "tmm_fast", 1.0

    def __init__(self):
        import tmm_fast

        self._solve = tmm_fast.coh_tmm

    def powers(self, index, thickness_um, angles, wavelengths_um):
        nk = np.broadcast_to(index[None, :, None], (1, len(index), len(wavelengths_um)))
        depths = np.concatenate([[np.inf], thickness_um, [np.inf]])[None]
        found = [self._solve(p, nk, depths, angles, wavelengths_um, device="cpu") for p in "sp"]
        return np.array([np.asarray(z[power][0]) for power in "RT" for z in found])


class TmmaxStack:
    """Its kernel, with indices instead of names of materials; it computes in float32."""

    package, share = "tmmax", 1.0

    def __init__(self):
        import jax
        import jax.numpy as jnp
        from tmmax.tmm import vectorized_coh_tmm

        self._solve, self._jnp, self._enable_x64 = vectorized_coh_tmm, jnp, jax.enable_x64

    def powers(self, index, thickness_um, angles, wavelengths_um):
        jnp = self._jnp
        ends = np.array([1e-3, 1e3])  # its tables of n and k, constant here
        tables = [[ends, [n.real] * 2, [n.imag] * 2] for n in index]
        with self._enable_x64(False):
            tables, depths, *light = (
                jnp.asarray(x) for x in (tables, thickness_um, wavelengths_um, angles)
            )
            media = jnp.arange(len(index))
            found = [
                self._solve(tables, media, depths, *light, jnp.asarray([p == "p"])) for p in "sp"
            ]
            return np.array([np.asarray(z[power]) for power in (0, 1) for z in found])


class JaxLayerLumosStack:
    package, share = "jaxlayerlumos", 1.0

    def __init__(self):
        import jax.numpy as jnp
        import jaxlayerlumos

        self._solve, self._jnp = jaxlayerlumos.stackrt_n_k, jnp

    def powers(self, index, thickness_um, angles, wavelengths_um):
        nk = np.broadcast_to(index, (len(wavelengths_um), len(index)))
        depths = np.concatenate([[0.0], thickness_um * 1e-6, [0.0]])
        frequencies = 299792458.0 / (wavelengths_um * 1e-6)
        given = (nk, depths, frequencies, np.degrees(angles))
        R_s, T_s, R_p, T_p = self._solve(*(self._jnp.asarray(x) for x in given))
        return np.array([R_s, R_p, T_s, T_p])


class PyElliStack:
    package, share = "elli", 0.1

    def __init__(self):
        import elli

        self._elli = elli

    def powers(self, index, thickness_um, angles, wavelengths_um):
        elli = self._elli
        media = [elli.IsotropicMaterial(elli.ConstantRefractiveIndex(n=complex(n))) for n in index]
        layers = [elli.Layer(m, 1e3 * d) for m, d in zip(media[1:-1], thickness_um, strict=True)]
        structure = elli.Structure(media[0], layers, media[-1])
        out = []
        for angle in np.degrees(angles):
            found = structure.evaluate(1e3 * wavelengths_um, float(angle), solver=elli.Solver2x2)
            out.append([found.R_ss, found.R_pp, found.T_ss, found.T_pp])
        return np.moveaxis(np.array(out), 0, 1)


class PyMooshStack:
    """By its scattering matrices, the method that it names as the stable one."""

    package, share = "PyMoosh", 0.005

    def __init__(self):
        import PyMoosh

        self._moosh = PyMoosh

    def powers(self, index, thickness_um, angles, wavelengths_um):
        depths = [100.0, *(1e3 * thickness_um), 100.0]
        structure = self._moosh.Structure(
            [complex(n) ** 2 for n in index], list(range(len(index))), depths, verbose=False
        )
        out = np.full((4, len(angles), len(wavelengths_um)), np.nan)
        for i, angle in enumerate(angles):
            for j, wavelength in enumerate(wavelengths_um):
                for p in (0, 1):
                    found = self._moosh.coefficient_S(structure, 1e3 * wavelength, angle, p)
                    out[p, i, j], out[p + 2, i, j] = found[2], found[3]
        return out


class TmmFasterStack:
    """Transfer matrices in C++, on all cores."""

    package, share = "tmm_faster", 1.0

    def __init__(self):
        import tmm_faster

        self._solve = tmm_faster.calc_coherent

    def powers(self, index, thickness_um, angles, wavelengths_um):
        media = np.tile(index, (len(wavelengths_um), 1))
        depths = [np.inf, *(1e3 * thickness_um), np.inf]
        found = self._solve(media, depths, np.degrees(angles), 1e3 * wavelengths_um)
        return np.array([np.asarray(found[name]).T for name in ("R_s", "R_p", "T_s", "T_p")])


class OptilandStack:
    package, share = "optiland", 1.0

    def __init__(self):
        from optiland.materials import IdealMaterial
        from optiland.thin_film import ThinFilmStack

        self._material, self._stack = IdealMaterial, ThinFilmStack

    def powers(self, index, thickness_um, angles, wavelengths_um):
        first, *films, last = (self._material(float(n.real), float(n.imag)) for n in index)
        structure = self._stack(first, last)
        for film, depth in zip(films, thickness_um, strict=True):
            structure.add_layer(film, float(depth))
        found = [structure.compute_rtRTA(wavelengths_um, angles, p) for p in "sp"]
        return np.array([np.asarray(z[power]).T for power in "RT" for z in found])


PEERS = (
    TmmStack,
    TmmFastStack,
    TmmaxStack,
    JaxLayerLumosStack,
    PyElliStack,
    PyMooshStack,
    TmmFasterStack,
    OptilandStack,
)


def installed() -> tuple[dict, dict[str, str]]:
    """{package: peer} of those that are there, and {package: reason} of the others."""
    found, left_out = {}, {}
    for peer in PEERS:
        try:
            found[peer.package] = peer()
        except Exception as error:  # a foreign package may fail in any way
            left_out[peer.package] = f"{type(error).__name__}: {str(error)[:100]}"
    return found, left_out
