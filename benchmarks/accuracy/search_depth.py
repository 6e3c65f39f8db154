"""Entries of the accuracy search: uniaxial layers, fields in depth, graded layers."""

import gmpy2
import jax
import jax.numpy as jnp
import numpy as np

from benchmarks.accuracy import search_layers
from benchmarks.accuracy.search_functions import Function, decades, plain_entry
from benchmarks.accuracy.search_layers import drawn_stack, fields, normal_wavevectors, stack_limits
from fresnel_jax import layers

_J, _MEDIUM = gmpy2.mpc(0, 1), ((0.1, 5.0), (1e-9, 5.0))


def _of_p(K2, N, Q, E):
    """Q of p in media of ordinary indices N, with Q of s, and extraordinary E; None: isotropic."""
    found = []
    for n, q, e in zip(N, Q, E, strict=True):
        if e is not None:
            q = gmpy2.sqrt(n * n * (1 - K2 / (e * e)))
            q = -q if (q / (n * n)).real < 0 else q  # power goes away from the boundary
        found.append(q)
    return found


def _uniaxial(c, n0, *columns):
    """A film and a substrate, each n_o, k_o, n_e, k_e; then as of a stack."""
    film, substrate, rest = columns[:4], columns[4:8], columns[8:]
    E = [None, gmpy2.mpc(*film[2:]), gmpy2.mpc(*substrate[2:])]
    ordinary = *film[:2], *substrate[:2]
    return search_layers.stack(c, n0, *ordinary, *rest, of_p=lambda *a: _of_p(*a, E))


def _our_uniaxial(c, n0, *columns):
    index = [a + 1j * b for a, b in zip(columns[:8:2], columns[1:8:2], strict=True)]
    media, (d, w) = [n0, layers.Uniaxial(*index[:2]), layers.Uniaxial(*index[2:])], columns[8:]
    out = layers.stack(c, media, thickness_um=[d], wavelength_um=w)
    return *out[:8], *out.A_s, *out.A_p


def _drawn_uniaxial(random, size, eps):
    c, n0, *film = drawn_stack(random, size, 1)
    along = drawn_stack(random, size, 1)
    return [c, n0, *film[:2], *along[2:4], *film[2:4], *along[4:6], *film[4:]]


def _fields(c, n0, n, k, n_e, k_e, n_2, k_2, n_t, k_t, d, d_2, w, z):
    """E_x, E_y, E_z and the absorption of s and p, at z in a uniaxial film on another one.

    An error counts beside the larger one of the two waves of the medium, where it is largest, for
    each radian of the phases of both films.
    """
    edges = 0, d, d + d_2
    if min(abs(z / x - 1) for x in edges[1:]) < 1e-5:
        return None  # rounding decides which medium it is
    with gmpy2.context(gmpy2.get_context(), precision=1800):
        N, Q = normal_wavevectors(c, [(n0, None), (n, k), (n_2, k_2), (n_t, k_t)])
        K2, E = N[0] ** 2 * (1 - c * c), [N[0], gmpy2.mpc(n_e, k_e), *N[2:]]
        j, k0 = sum(z > x for x in edges), 2 * gmpy2.const_pi() / w
        Q_p, found = _of_p(K2, N, Q, [None, E[1], None, None]), []
        Y_p = [q / (m * m) for q, m in zip(Q_p, N, strict=True)]
        for along_z, Y in ((Q, Q), (Q_p, Y_p)):
            inside = fields(Y, along_z, (d, d_2), w)
            incident = (Y[0] * inside[0][0] + inside[0][1]) / (2 * Y[0])
            U, V = (x / incident for x in inside[j - 1])
            down, up = (U + V / Y[j]) / 2, (U - V / Y[j]) / 2
            far = z if j == 3 else edges[j]
            here, there = (gmpy2.exp(_J * k0 * along_z[j] * (x - edges[j - 1])) for x in (z, far))
            largest = max(abs(down), abs(up / there))
            found += [down * here + up / here, down * here - up / here, largest, Y[j]]
        E_y, _, s, _, H, V, p, y = found
        E_x, E_z = N[0] * y, -gmpy2.sqrt(K2) * N[0] / E[j] ** 2  # of unit V, of unit H
        per = k0 / (n0 * c)
        across, along = (per * (m * m).imag for m in (N[j], E[j]))
        radians = 1 + k0 * (max(abs(N[1]), abs(E[1])) * d + abs(N[2]) * d_2)
        absorbed = across * gmpy2.norm(E_x * V) + along * gmpy2.norm(E_z * H)
        most = across * gmpy2.norm(E_x * p) + along * gmpy2.norm(E_z * p)
        found = (
            (E_x * V, abs(E_x * p)),
            (E_y, s),
            (E_z * H, abs(E_z * p)),
            (across * gmpy2.norm(E_y), across * s * s),
            (absorbed, most),
        )
        return [(value, scale * radians) for value, scale in found]


def _our_fields(c, n0, n, k, n_e, k_e, n_2, k_2, n_t, k_t, d, d_2, w, z):
    media = [n0, layers.Uniaxial(n + 1j * k, n_e + 1j * k_e), n_2 + 1j * k_2, n_t + 1j * k_t]
    return layers.fields_at_depth(c, media, thickness_um=[d, d_2], wavelength_um=w, depth_um=z)


def _drawn_fields(random, size, eps):
    c, n0, *rest = drawn_stack(random, size, 2)
    c = np.where(c > 1.0 - 1e-9, 0.5, c)  # there E_z grows as the sine
    along = drawn_stack(random, size, 1)[2:4]
    return [c, n0, *rest[:2], *along, *rest[2:], decades(random, size, -4.0, 0.5)]


_LAYERS = 64


def _graded(c, n, ratio, n_t, k_t, d, w):
    """R_s and R_p of a layer whose N^2 is linear in the depth, by the power series of its fields.

    The scale is that of what slicing leaves, over the eps of float64.
    """
    with gmpy2.context(gmpy2.get_context(), precision=300):
        near, far, turn = n * n, (n * ratio) ** 2, -_J * 2 * gmpy2.const_pi() * d / w
        K2, step = 1 - c * c, near - far
        substrate2 = gmpy2.mpc(n_t, k_t) ** 2
        q, found = gmpy2.sqrt(substrate2 - K2), []
        for s, Y in ((True, c), (False, c)):
            u, v = [gmpy2.mpc(1)], [q if s else q / substrate2]
            for i in range(300):
                before_u, before_v = (u[-2], v[-2]) if i else (0, 0)
                rise = turn * ((far - K2) * u[-1] + step * before_u)
                u.append(turn * (v[-1] if s else far * v[-1] + step * before_v) / (i + 1))
                v.append((rise if s else (rise - step * i * v[-1]) / far) / (i + 1))
            U, V = sum(u), sum(v)
            found.append(gmpy2.norm((Y * U - V) / (Y * U + V)))
        radians = abs(turn) * max(n, n * ratio)
        change = abs(step) / min(near, far)
        slices = change * ((1 + radians) / _LAYERS) ** 4
        return [(R, slices * gmpy2.mpfr(2) ** 52) for R in found]


def _our_graded(c, n, ratio, n_t, k_t, d, w):
    media, thicknesses = layers.graded_layer(
        lambda z: n * jnp.sqrt(1.0 + (ratio * ratio - 1.0) * (z / d)), d, layers=_LAYERS
    )
    media = [1.0, *media, jax.lax.complex(n_t, k_t)]
    out = layers.stack(c, media, thickness_um=thicknesses, wavelength_um=w, exact=False)
    return out.R_s, out.R_p


_UNIAXIAL = Function(
    _drawn_uniaxial,
    (*stack_limits(())[:2], *_MEDIUM * 4, *stack_limits([(1e-4, 2.0)])[-2:]),
    _our_uniaxial, _uniaxial, 64.0, conditioned=True, coupled=((0, 4), (1, 5)),
)  # fmt: skip
DEPTH = {
    "stack of uniaxial media": _UNIAXIAL,
    "gradient of stack of uniaxial media": _UNIAXIAL._replace(bound=None, gradient_bound=200.0),
    "fields_at_depth": Function(
        _drawn_fields,
        ((1e-6, 1.0 - 1e-9), (1.0, 2.0), *_MEDIUM * 4, *[(1e-4, 2.0)] * 2, (0.3, 2.0), (1e-4, 3.0)),
        _our_fields, _fields, 200.0, 1e5, conditioned=True,
    ),
    "graded_layer": plain_entry(
        ((0.01, 1.0), (1.2, 2.0), (0.8, 1.25), (1.3, 5.0), (1e-3, 5.0), (0.02, 1.0), (0.4, 2.0)),
        _our_graded, _graded, 1.0, dtypes=(np.float64,),
    ),
}  # fmt: skip
