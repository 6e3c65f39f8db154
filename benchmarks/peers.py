"""Other people's packages as contestants; each is imported only in the process that measures it.

`points(c, eta, k)` gives R of unpolarized light at points that each have a material of their own;
`curve(c, eta, k)` the same for one material at many angles, the way in which the package is fast.
`in_jax(c, eta, k)` is R as a function that JAX can compile; `gradient(c, eta, k)` the derivatives
of R, (3, N), of another package that has them.
"""

import glob
import os

import numpy as np


class Tmm:
    """tmm.interface_r on arrays, the fastest way through that package."""

    package, dtypes = "tmm", ("float64",)

    def __init__(self, dtype):
        import tmm

        self._r = tmm.interface_r

    def points(self, c, eta, k):
        index, angle = eta + 1j * k, np.arccos(c)
        inside = np.arcsin(np.sin(angle) / index)
        R = (abs(self._r(p, 1.0, index, angle, inside)) ** 2 for p in "sp")
        return 0.5 * sum(R)

    curve = points


class TmmFast:
    package, dtypes = "tmm_fast", ("float64",)

    def __init__(self, dtype):
        import tmm_fast
        import torch

        self._solve, self._torch = tmm_fast.coh_tmm, torch

    def _R(self, index, angle):
        torch = self._torch
        layers = torch.stack([torch.ones_like(index), index], 1)[:, :, None]
        thickness = torch.full((len(layers), 2), np.inf, dtype=torch.float64)
        wavelength = torch.ones(1, dtype=torch.float64)
        R = sum(self._solve(p, layers, thickness, angle, wavelength)["R"] for p in "sp")
        return 0.5 * R[:, :, 0]

    def _of_arrays(self, c, index):
        angle, index = self._torch.as_tensor(np.arccos(c)), self._torch.as_tensor(index)
        return self._R(index, angle).numpy()

    def points(self, c, eta, k):
        return np.diagonal(self._of_arrays(c, eta + 1j * k))

    def curve(self, c, eta, k):
        return self._of_arrays(c, np.atleast_1d(eta + 1j * k))[0]

    def gradient(self, c, eta, k):
        # One by one: a NaN of a grid would fill the derivatives of all its points.
        out = []
        for point in zip(c, eta, k, strict=True):
            cosine, *index = (self._torch.tensor([x], requires_grad=True) for x in point)
            self._R(self._torch.complex(*index), self._torch.arccos(cosine)).sum().backward()
            out.append([x.grad.item() for x in (cosine, *index)])
        return np.array(out).T


class Tmmax:
    """The Fresnel coefficients of tmmax under jax.jit."""

    package, dtypes = "tmmax", ("float32", "float64")

    def __init__(self, dtype):
        import jax
        import jax.numpy as jnp
        from tmmax.fresnel import fresnel_p, fresnel_s

        def R(c, eta, k):
            index, angle = jax.lax.complex(eta, k), jnp.arccos(c)
            inside = jnp.arcsin(jnp.sin(angle) / index)
            r = (f(1.0, index, angle, inside)[0] for f in (fresnel_s, fresnel_p))
            return 0.5 * sum(jnp.abs(z) ** 2 for z in r)

        self.in_jax = R
        self.points = self.curve = jax.jit(R)


class JaxLayerLumos:
    """Its gradient is not counted: jit and vmap of it end in an error, and a point takes 0.3 s."""

    package, dtypes = "jaxlayerlumos", ("float64",)

    def __init__(self, dtype):
        import jax.numpy as jnp
        import jaxlayerlumos

        self._solve, self._jnp = jaxlayerlumos.stackrt_n_k, jnp

    def _grid(self, index, c):
        jnp = self._jnp
        layers = jnp.asarray(np.stack([np.ones_like(index), index], 1))
        frequencies = jnp.full(len(index), 5e14)
        angles = jnp.asarray(np.degrees(np.arccos(np.asarray(c))))
        R_s, _, R_p, _ = self._solve(layers, jnp.zeros(2), frequencies, angles)
        return 0.5 * (R_s + R_p)

    def points(self, c, eta, k):
        return np.diagonal(self._grid(np.asarray(eta) + 1j * np.asarray(k), c))

    def curve(self, c, eta, k):
        return self._grid(np.atleast_1d(np.asarray(eta) + 1j * np.asarray(k)), c)[:, 0]


class PyElli:
    """One angle and many wavelengths in a curve: this package's vectorised axis."""

    package, dtypes = "elli", ("float64",)

    def __init__(self, dtype):
        import elli

        self._elli = elli

    def _R(self, index, angle, wavelengths):
        elli = self._elli
        media = [
            elli.IsotropicMaterial(elli.ConstantRefractiveIndex(n=n)) for n in (1.0, complex(index))
        ]
        structure = elli.Structure(media[0], [], media[1])
        result = structure.evaluate(wavelengths, float(angle), solver=elli.Solver2x2)
        return 0.5 * (result.R_ss + result.R_pp)

    def points(self, c, eta, k):
        degrees = np.degrees(np.arccos(c))
        one = np.array([500.0])
        points = zip(eta + 1j * k, degrees, strict=True)
        return np.array([self._R(n, angle, one)[0] for n, angle in points])

    def curve(self, c, eta, k):
        return self._R(eta + 1j * k, 60.0, np.linspace(400.0, 700.0, len(c)))


class PyMoosh:
    package, dtypes = "PyMoosh", ("float64",)

    def __init__(self, dtype):
        import PyMoosh

        self._moosh = PyMoosh

    def _structure(self, index):
        layers = [1.0, complex(index) ** 2]
        return self._moosh.Structure(layers, [0, 1], [100, 100], verbose=False)

    def points(self, c, eta, k):
        solve = self._moosh.coefficient_S
        return np.array(
            [
                0.5 * sum(solve(self._structure(n), 500.0, angle, p)[2] for p in (0, 1))
                for n, angle in zip(eta + 1j * k, np.arccos(c), strict=True)
            ]
        )

    def curve(self, c, eta, k):
        return self.points(c, np.full_like(c, eta), np.full_like(c, k))


class Mitsuba:
    package, dtypes = "mitsuba", ("float32",)

    def __init__(self, dtype):
        if "DRJIT_LIBLLVM_PATH" not in os.environ:
            found = sorted(
                x
                for p in ("/usr/lib/*/libLLVM.so.*", "/usr/lib/llvm-*/lib/libLLVM.so.*")
                for x in glob.glob(p)
            )
            if not found:
                raise ImportError("no libLLVM.so.* of LLVM 16 or newer was found")
            os.environ["DRJIT_LIBLLVM_PATH"] = found[-1]
        import drjit
        import mitsuba

        mitsuba.set_variant("llvm_ad_rgb")
        self._mitsuba, self._drjit = mitsuba, drjit
        self._on_device = {}

    def _move(self, x):
        # timed calls pass the same arrays again: moving them is not what is measured
        if id(x) not in self._on_device:
            self._on_device[id(x)] = (x, self._mitsuba.Float(np.asarray(x, np.float32).reshape(-1)))
        return self._on_device[id(x)][1]

    def points(self, c, eta, k):
        mi = self._mitsuba
        R = mi.fresnel_conductor(self._move(c), mi.Complex2f(self._move(eta), self._move(k)))
        self._drjit.eval(R)
        self._drjit.sync_thread()
        return R

    curve = points

    def gradient(self, c, eta, k):
        mi, dr = self._mitsuba, self._drjit
        variables = [mi.Float(x) for x in (c, eta, k)]
        dr.enable_grad(*variables)
        cosine, *index = variables
        dr.backward(mi.fresnel_conductor(cosine, mi.Complex2f(*index)))
        return np.array([dr.grad(x).numpy() for x in variables])


ALL = {x.__name__: x for x in (Tmm, TmmFast, Tmmax, JaxLayerLumos, PyElli, PyMoosh, Mitsuba)}
