"""Every numbered equation of docs/derivations holds, at random points and to 35 digits.

Each check yields pairs: the equation as the page prints it, and what it is said to be, from
textbook forms (`oracle`, `stack_oracle`), numerical derivatives, quadrature or linear equations.
"""

import itertools
import random
import re
from pathlib import Path

import jax
import jax.numpy as jnp
import mpmath as mp
import numpy as np
import pytest

from fresnel_jax import amplitudes, layers, polarization, powers, reflectance
from tests.truth import oracle, stack_oracle

pytestmark = pytest.mark.docs  # of `make test-docs`
PAGES = sorted((Path(__file__).resolve().parents[2] / "docs" / "derivations").glob("*.md"))
CHECKS = {}


def check(number):
    def keep(function):
        assert number not in CHECKS, f"({number}) has two checks"
        CHECKS[number] = function
        return function

    return keep


def draw(rng, low, high):
    return mp.mpf(rng.uniform(low, high))


def quadrature(function, end):
    """The integral from 0 of a function that varies by some radians."""
    return mp.quad(function, [0, end], method="gauss-legendre")


def slope(function, x):
    """The derivative of a complex function by a real argument."""
    return mp.diff(function, x)


# One boundary and phases -------------------------------------------------------------------


class Boundary:
    """A random boundary, its textbook amplitudes, and the quantities of the page."""

    def __init__(self, rng, lossless=False):
        c, n, m = draw(rng, 0.1, 0.95), draw(rng, 0.3, 3.0), draw(rng, 0.7, 2.0)
        self.at(c, n, mp.mpf(0) if lossless else draw(rng, 0.01, 2.0), m)

    def at(self, c, n, k, m):
        self.c, self.n, self.k, self.m = self.arguments = c, n, k, m
        self.N, self.s2 = mp.mpc(n, k), (1 - c) * (1 + c)
        self.Q = mp.sqrt(self.N**2 - m**2 * self.s2)
        self.a, self.b = self.Q.real, self.Q.imag
        self.C, self.sigma = m * c, m**2 * self.s2
        self.D = (self.N - m) * (self.N + m)
        self.S, self.X = m * c + self.Q, m * c * self.Q + self.sigma
        self.Y = c**2 * self.N**2 - self.sigma
        self.Z = self.Y + self.s2 * self.D
        self.P = c * self.N**2 + m * self.Q
        self.U = abs(self.C * self.Q) ** 2 + self.sigma**2
        self.r_s, self.r_p, self.t_s, self.t_p = oracle.amplitudes(c, n, k, m)
        self.R_s, self.R_p, self.T_s, self.T_p = oracle.powers(c, n, k, m)

    def slopes(self, function):
        """The derivatives of a function of (c, n, k, m) by each of them."""
        for i in range(4):
            yield slope(
                lambda x, i=i: function(
                    *(x if j == i else z for j, z in enumerate(self.arguments))
                ),
                self.arguments[i],
            )


def plane_wave(b):
    """E_y (or H_y) = exp(i (K x + Q z)) in the second medium, k_0 = 1; as a function of x and z."""
    K = b.m * mp.sqrt(b.s2)
    return K, lambda x, z: mp.exp(1j * (K * x + b.Q * z))


@check("B1")
def _(rng):
    b = Boundary(rng)
    _, E = plane_wave(b)
    x, z = draw(rng, 0, 1), draw(rng, 0, 1)
    # the wave equation, and Snell's law
    yield -(mp.diff(E, (x, z), (2, 0)) + mp.diff(E, (x, z), (0, 2))), b.N**2 * E(x, z)
    sin_t = b.m * mp.sqrt(1 - b.c**2) / b.N
    yield b.Q, b.N * mp.sqrt(1 - sin_t**2)


@check("B2")
def _(rng):
    b = Boundary(rng)
    K, wave = plane_wave(b)
    x, z = draw(rng, 0, 1), draw(rng, 0, 1)
    by_x, by_z, here = mp.diff(wave, (x, z), (1, 0)), mp.diff(wave, (x, z), (0, 1)), wave(x, z)
    # curl of (0, f, 0) is (-df/dz, 0, df/dx): i H of E, and -i N^2 E of H
    yield -b.Q * here, -by_z / 1j
    yield K * here, by_x / 1j
    yield b.Q / b.N**2 * here, -by_z / (-1j * b.N**2)
    yield -K / b.N**2 * here, by_x / (-1j * b.N**2)


@check("B3")
def _(rng):
    for re_q2 in (draw(rng, 0, 2), draw(rng, -2, 0)):
        im_q2 = draw(rng, 0, 2)
        q2 = mp.mpc(re_q2, im_q2)
        large = mp.sqrt((abs(q2) + abs(re_q2)) / 2)
        small = im_q2 / (2 * large)
        yield mp.mpc(large, small) if re_q2 >= 0 else mp.mpc(small, large), mp.sqrt(q2)


@check("B4")
def _(rng):
    b = Boundary(rng)
    q2 = b.N**2 - (b.m * mp.sin(mp.acos(b.c))) ** 2
    yield b.n**2 - b.m**2 + (b.m * b.c) ** 2 - b.k**2, q2.real
    yield 2 * b.n * b.k, q2.imag


@check("B5")
def _(rng):
    b = Boundary(rng)
    # 1 + r = t and m c (1 - r) = Q t
    r, t = mp.lu_solve(mp.matrix([[-1, 1], [b.C, b.Q]]), mp.matrix([1, b.C]))
    yield (b.C - b.Q) / (b.C + b.Q), r
    yield 2 * b.C / (b.C + b.Q), t
    yield b.r_s, r
    yield b.t_s, t


@check("B6")
def _(rng):
    b = Boundary(rng)
    r, tau = mp.lu_solve(mp.matrix([[-1, 1], [b.c / b.m, b.Q / b.N**2]]), mp.matrix([1, b.c / b.m]))
    top, bottom = b.c * b.N**2 - b.m * b.Q, b.c * b.N**2 + b.m * b.Q
    yield top / bottom, r
    yield 2 * b.m * b.c * b.N / bottom, tau * b.m / b.N
    yield b.r_p, r
    yield b.t_p, tau * b.m / b.N


@check("B7")
def _(rng):
    b = Boundary(rng)
    yield -b.D / b.S**2, b.r_s


@check("B8")
def _(rng):
    b = Boundary(rng)
    yield b.D * b.Y, b.c**2 * b.N**4 - b.m**2 * b.Q**2


@check("B9")
def _(rng):
    b = Boundary(rng)
    yield b.S * b.X / b.m, b.P


@check("B10")
def _(rng):
    b = Boundary(rng)
    yield b.D * b.Y * b.m**2 / (b.S * b.X) ** 2, b.r_p
    yield 2 * b.m * b.c * b.N * b.m / (b.S * b.X), b.t_p


@check("B11")
def _(rng):
    b = Boundary(rng)
    Y = b.c**2 * b.N**2 - (b.m * mp.sin(mp.acos(b.c))) ** 2
    yield b.c**2 * b.n**2 - b.m**2 + b.C**2 - b.c**2 * b.k**2, Y.real
    yield 2 * b.c**2 * b.n * b.k, Y.imag


@check("B12")
def _(rng):
    b = Boundary(rng)
    # Re(E x conj H) along z is -Re(E_y conj H_x) and Re(E_x conj H_y), of transmitted over incident
    H_x = -b.Q * b.t_s
    yield abs(b.t_s) ** 2 * b.Q.real / b.C, -(b.t_s * mp.conj(H_x)).real / b.C
    H_y = b.t_p * b.N / b.m  # of an incident wave of unit H_y, whose E_x is c / m
    yield (
        abs(b.t_p) ** 2 * (mp.conj(b.N) * b.Q / b.N).real / b.C,
        (b.Q / b.N**2 * H_y * mp.conj(H_y)).real * b.m / b.c,
    )


@check("B13")
def _(rng):
    b = Boundary(rng)
    yield b.C**2 + abs(b.Q) ** 2 + 2 * b.C * b.a, abs(b.S) ** 2
    q2 = abs(b.Q) ** 2
    yield (
        b.c**2 * abs(b.N) ** 4 + b.m**2 * q2 + 2 * b.C * b.a * (b.sigma + q2),
        abs(b.P) ** 2,
    )


@check("B14")
def _(rng):
    b = Boundary(rng)
    yield 4 * b.C * b.a / abs(b.S) ** 2, 1 - b.R_s
    yield 4 * b.C * b.a * (abs(b.Q) ** 2 + b.sigma) / abs(b.P) ** 2, 1 - b.R_p


@check("B15")
def _(rng):
    b = Boundary(rng)
    contrast = abs(b.N - b.m) ** 2 * abs(b.N + b.m) ** 2
    yield contrast / abs(b.S) ** 4, b.R_s
    yield contrast * abs(b.Y) ** 2 / abs(b.P) ** 4, b.R_p


@check("B16")
def _(rng):
    b = Boundary(rng)
    yield b.R_s * b.U / abs(b.X) ** 2, (b.R_s + b.R_p) / 2
    yield b.U + 2 * b.sigma * b.C * b.a, abs(b.X) ** 2


@check("B17")
def _(rng):
    b = Boundary(rng, lossless=True)
    T = (b.T_s + b.T_p) / 2  # 0 in total reflection
    yield b.T_s / 2 * (1 + (b.m * b.n) ** 2 / abs(b.X) ** 2), T


@check("B18")
def _(rng):
    b = Boundary(rng)
    by_c, by_n, by_k, _ = b.slopes(lambda *x: oracle.amplitudes(*x)[0])
    yield -b.N * b.t_s / (b.Q * b.S), by_n
    yield -b.N * b.t_s / (b.Q * b.S) * 1j, by_k
    yield -2 * b.m * b.r_s / b.Q, by_c


@check("B19")
def _(rng):
    b = Boundary(rng)
    by_c, by_n, by_k, _ = b.slopes(lambda *x: oracle.amplitudes(*x)[1])
    by_N = b.N * b.t_s * b.m**2 * b.Z / (b.Q * b.S * b.X**2)
    yield by_N, by_n
    yield 1j * by_N, by_k
    yield -2 * b.m**3 * b.N**2 * b.r_s / (b.Q * b.X**2), by_c


@check("B20")
def _(rng):
    b = Boundary(rng)
    yield b.Y + b.s2 * b.D, 2 * b.Q**2 - b.N**2


@check("B21")
def _(rng):
    b = Boundary(rng)
    for i in range(2):
        _, by_n, _, by_m = b.slopes(lambda *x, i=i: oracle.amplitudes(*x)[i])
        yield -b.N * by_n, b.m * by_m
    yield 1 + b.r_s, b.t_s
    yield b.m / b.N * (1 + b.r_p), b.t_p


@check("B22")
def _(rng):
    b = Boundary(rng)
    _, by_n, by_k, _ = b.slopes(lambda *x: oracle.powers(*x)[0])
    yield 4 * b.C * mp.conj(b.D) * b.N / (b.Q * abs(b.S) ** 4), by_n - 1j * by_k


@check("B23")
def _(rng):
    b = Boundary(rng)
    _, by_n, by_k, _ = b.slopes(lambda *x: oracle.powers(*x)[1])
    G = b.C * mp.conj(b.D) * b.N / (b.Q * abs(b.S) ** 4)
    yield 4 * G * b.m**4 * b.Z * mp.conj(b.Y) / abs(b.X) ** 4, by_n - 1j * by_k


@check("B24")
def _(rng):
    b = Boundary(rng)
    s, p = (next(b.slopes(lambda *x, i=i: oracle.powers(*x)[i])) for i in range(2))
    yield -4 * b.m * b.R_s * (1 / b.Q).real, s
    L = b.m**4 * mp.conj(b.Y) / abs(b.X) ** 4
    yield 4 * b.m * b.R_s * (b.N**2 / b.Q * L).real, p


def unpolarized(*arguments):
    R_s, R_p, _, _ = oracle.powers(*arguments)
    return (R_s + R_p) / 2


@check("B25")
def _(rng):
    b = Boundary(rng)
    _, by_n, by_k, _ = b.slopes(unpolarized)
    x2 = abs(b.X) ** 2
    E = b.D * b.U + abs(b.D) ** 2 * b.sigma * b.m**2 * b.Y / (2 * x2)
    bottom = abs(b.S) ** 4 * x2 * abs(b.Q) ** 2
    yield 4 * b.C * b.N * mp.conj(b.Q * E) / bottom, by_n - 1j * by_k


@check("B26")
def _(rng):
    b = Boundary(rng)
    bracket = (
        (b.C**2 + b.Q**2) * (b.C * mp.conj(b.Q) - b.sigma)
        - 4 * b.C * b.Q * (b.C * b.Q).real
        - 2 * b.sigma * b.X
    )
    H = b.sigma * mp.conj(b.Q * b.X) * bracket / (abs(b.Q) ** 2 * abs(b.X) ** 4)
    yield 2 * b.m * b.R_s * H.real, next(b.slopes(unpolarized))


# Phases --------------------------------------------------------------------------------------


def minus_r_s(*x):
    return -oracle.amplitudes(*x)[0]


def minus_ratio(*x):
    r_s, r_p, _, _ = oracle.amplitudes(*x)
    return -r_p / r_s


@check("P1")
def _(rng):
    b = Boundary(rng)
    f, g = minus_r_s(*b.arguments), minus_ratio(*b.arguments)
    yield b.D / b.S**2, f
    yield (b.Q - b.C) / (b.Q + b.C), f
    yield b.m**2 * b.Y / b.X**2, g
    yield (b.C * b.Q - b.sigma) / (b.C * b.Q + b.sigma), g


@check("P2")
def _(rng):
    b = Boundary(rng)
    yield 2 * b.C * b.b / abs(b.S) ** 2, minus_r_s(*b.arguments).imag
    yield (
        2 * b.m**3 * b.c * b.s2 * b.b / abs(b.X) ** 2,
        minus_ratio(*b.arguments).imag,
    )


@check("P3")
def _(rng):
    b = Boundary(rng)
    f, g = minus_r_s(*b.arguments), minus_ratio(*b.arguments)
    ratio = b.r_p / b.r_s
    yield mp.expj(mp.arg(f) - mp.pi), b.r_s / abs(b.r_s)
    yield mp.expj(-(mp.pi - mp.arg(g))), ratio / abs(ratio)


@check("P4")
def _(rng):
    b = Boundary(rng)
    b.at(draw(rng, 0.1, 0.5), draw(rng, 0.5, 0.8), mp.mpf(0), mp.mpf(1))  # total reflection
    yield mp.expj(-2 * mp.atan(b.b / (b.m * b.c))), b.r_s
    yield mp.expj(-2 * mp.atan(b.c * b.b / (b.m * b.s2))), b.r_p / b.r_s


@check("P5")
def _(rng):
    b = Boundary(rng)
    by_c, by_n, by_k, _ = b.slopes(minus_r_s)
    yield 2 * b.N * b.C / (b.Q * b.S**2), by_n
    yield 2j * b.N * b.C / (b.Q * b.S**2), by_k
    yield -2 * b.m * b.D / (b.Q * b.S**2), by_c


@check("P6")
def _(rng):
    b = Boundary(rng)
    by_c, by_n, by_k, _ = b.slopes(minus_ratio)
    by_N = 2 * b.N * b.m**3 * b.c * b.s2 / (b.Q * b.X**2)
    yield by_N, by_n
    yield 1j * by_N, by_k
    yield 2 * b.m**3 / b.X**2 * (b.c**2 * b.N**2 / b.Q + b.Q), by_c


def log_ratio(*x):
    return mp.log(abs(minus_ratio(*x)))


@check("P7")
def _(rng):
    b = Boundary(rng)
    y_1, N2 = b.Y.real, b.N**2
    bracket = (
        y_1 * (b.c**2 * N2.real + (b.Q**2).real)
        + b.c**2 * (1 + b.c**2) * N2.imag**2
        - 2 * b.m**2 * b.s2 * b.b**2
    )
    yield 2 * b.m / abs(b.Q * b.Y) ** 2 * b.a * bracket, next(b.slopes(log_ratio))


@check("P8")
def _(rng):
    b = Boundary(rng)
    _, by_n, by_k, _ = b.slopes(log_ratio)
    u_v, factor = b.N * mp.conj(b.Q), 2 * b.m * b.c * b.s2 / abs(b.Q * b.Y) ** 2
    yield factor * (u_v.real * b.Y.real + u_v.imag * b.Y.imag), by_n
    yield factor * (u_v.real * b.Y.imag - u_v.imag * b.Y.real), by_k


@check("P9")
def _(rng):
    b = Boundary(rng)
    v = b.m**2 * b.s2 * b.n * b.b / (b.n**2 + b.b**2)
    yield mp.mpc(b.n * b.a + b.k * b.b, -v), b.N * mp.conj(b.Q)


@check("P10")
def _(rng):
    b = Boundary(rng)
    rho = b.r_p / b.r_s
    psi, delta = mp.atan(abs(rho)), -mp.arg(rho)
    yield (1 - abs(rho) ** 2) / (1 + abs(rho) ** 2), mp.cos(2 * psi)
    yield 2 * rho / (1 + abs(rho) ** 2), mp.sin(2 * psi) * mp.expj(-delta)


@check("P11")
def _(rng):
    b = Boundary(rng)
    b.at(b.c, b.n + b.m, mp.mpf(0), b.m)
    yield b.T_s * b.m * b.n / b.X, mp.sqrt(b.T_s * b.T_p)


@check("P12")
def _(rng):
    b = Boundary(rng)
    wavelength = draw(rng, 0.3, 1.0)
    depth = wavelength / (4 * mp.pi * b.b)
    yield abs(mp.exp(2j * mp.pi / wavelength * b.Q * depth)) ** 2, mp.exp(-1)


# Coherent films ------------------------------------------------------------------------------


def dot(x, y):
    return x[0] * y[0] + x[1] * y[1]


def apply(matrix, x):
    return dot(matrix[0], x), dot(matrix[1], x)


def apply_transposed(matrix, x):
    return tuple(matrix[0][i] * x[0] + matrix[1][i] * x[1] for i in range(2))


def through(q2, g, kappa):
    """The matrix of a layer; (S3) compares it with the exponential of (S2)."""
    q = mp.sqrt(q2)
    cosine, sine = mp.cos_sin(kappa * q)
    return [[cosine, -1j * g * sine / q], [-1j * q * sine / g, cosine]]


def forward_root(z):
    root = mp.sqrt(z)
    return root if root.real + root.imag >= 0 else -root


class Films:
    """Random films, for s or p, and their fields by textbook matrices, without the factors f."""

    def __init__(self, rng, lossless_first=False, layers=3):
        self.p = rng.random() < 0.5
        self.c, self.wavelength = draw(rng, 0.2, 0.9), draw(rng, 0.4, 0.8)
        k_0 = mp.mpf(0) if lossless_first else draw(rng, 0.02, 0.2)
        self.N = [mp.mpc(draw(rng, 1.0, 1.6), k_0)]
        self.N += [mp.mpc(draw(rng, 1.0, 3.0), draw(rng, 0.1, 1.0)) for _ in range(layers + 1)]
        self.thickness = [draw(rng, 0.02, 0.2) for _ in range(layers)]
        self.K2 = self.N[0] ** 2 * (1 - self.c**2)
        self.q0 = self.N[0] * self.c
        self.q2 = [N**2 - self.K2 for N in self.N[1:]]
        self.g = [N**2 / self.N[0] ** 2 if self.p else mp.mpc(1) for N in self.N[1:]]
        self.q = [forward_root(z) for z in self.q2]
        self.z = [q / g for q, g in zip(self.q, self.g, strict=True)]
        self.kappa = [2 * mp.pi * d / self.wavelength for d in self.thickness]
        self.f = [mp.exp(1j * x * q) for x, q in zip(self.kappa, self.q[:-1], strict=True)]
        self.solve()

    def solve(self, q0=None, z_far=None, **replaced):
        """The fields at the near side of each layer and behind the last; B, r, log(1 / B)."""
        parts = {"q2": self.q2, "g": self.g, "kappa": self.kappa}
        for name, (i, value) in replaced.items():
            parts[name] = [value if i == j else z for j, z in enumerate(parts[name])]
        q0 = self.q0 if q0 is None else q0
        layers = list(zip(parts["q2"], parts["g"], parts["kappa"], strict=False))
        fields = [(mp.mpc(1), self.z[-1] if z_far is None else z_far)]
        matrices = [through(*layer) for layer in layers]
        for matrix in reversed(matrices):
            fields.insert(0, apply(matrix, fields[0]))
        B = q0 * fields[0][0] + fields[0][1]
        r = (q0 * fields[0][0] - fields[0][1]) / B
        if not replaced and z_far is None and q0 is self.q0:
            self.fields, self.B, self.r, self.matrices = fields, B, r, matrices
        return fields, B, r

    def functional(self, depth):
        """(a, b) at the near side of a layer: what B is of the fields (1, 0) and (0, 1) there."""
        found = []
        for fields in ((1, 0), (0, 1)):
            for matrix in reversed(self.matrices[:depth]):
                fields = apply(matrix, fields)
            found.append(self.q0 * fields[0] + fields[1])
        return tuple(found)

    def scaled(self, i):
        """The quantities of the page in layer i: fields with the factors f of all layers behind."""
        behind, front = mp.fprod(self.f[i + 1 :]), mp.fprod(self.f[:i])
        u, w = (x * behind for x in self.fields[i + 1])
        a, b = (x * front for x in self.functional(i))
        E = self.f[i] ** 2
        return {
            "u": u, "w": w, "a": a, "b": b, "E": E, "Z": self.z[i], "g": self.g[i],
            "Q": self.q[i], "kappa": self.kappa[i], "f": self.f[i],
            "S": self.z[i] * u + w, "D": self.z[i] * u - w,
            "C": (1 + E) / 2, "sigma": (1 - E) / (2 * self.q[i]),
            "B": self.B * mp.fprod(self.f), "front": front,
        }  # fmt: skip

    def inside(self, i, zeta):
        """(u, w) and (a, b) in layer i, at k_0 times the distance zeta from its far side."""
        of = self.q2[i], self.g[i]
        field = apply(through(*of, zeta), self.fields[i + 1])
        return field, apply_transposed(through(*of, self.kappa[i] - zeta), self.functional(i))

    def weights(self, i):
        N = self.N[i + 1]
        if not self.p:
            return self.q2[i].imag, mp.mpf(0)
        return -(self.K2 / N**2).imag, (N**2).imag / abs(self.N[0] ** 2) ** 2

    def loss(self, i):
        """The integral of (A1) over a layer."""
        t, m = self.weights(i)

        def density(field, of):
            return t * abs(field[0]) ** 2 + m * abs(field[1]) ** 2

        return integral(self, i, density)

    def flux(self, field):
        return (field[1] * mp.conj(field[0]) / (self.N[0] ** 2 if self.p else 1)).real

    def absorbed(self, i, fields):
        return self.flux(fields[i]) - self.flux(fields[i + 1])

    def truth(self):
        """R, T, r and the t of electric fields, of the textbook."""
        return stack_oracle.stack(self.c, self.N, self.thickness, self.wavelength)[self.p :: 2]


def standing_wave(films, rng):
    """U and W of layer 0 as functions of z, from the curl equations with k_0 = 1."""
    q, ahead, back = films.q[0], draw(rng, 0.5, 1), mp.mpc(draw(rng, 0, 1), draw(rng, 0, 1))

    def U(z):
        return ahead * mp.exp(1j * q * z) + back * mp.exp(-1j * q * z)

    def W(z):  # -H_x of E_y, or N_0^2 E_x of H_y
        slope_1j = 1j * q * (ahead * mp.exp(1j * q * z) - back * mp.exp(-1j * q * z)) / 1j
        return films.N[0] ** 2 * slope_1j / films.N[1] ** 2 if films.p else slope_1j

    return U, W


@check("S1")
def _(rng):
    films = Films(rng)
    z = draw(rng, 0, 1)

    def wave(x):
        return mp.exp(1j * films.q[0] * x)

    by_z = mp.diff(wave, z)
    W = films.N[0] ** 2 * by_z / (1j * films.N[1] ** 2) if films.p else by_z / 1j
    yield films.q[0] / films.g[0] * wave(z), W


@check("S2")
def _(rng):
    films = Films(rng)
    (U, W), z = standing_wave(films, rng), draw(rng, 0, 1)
    yield -1j * films.g[0] * W(z), -mp.diff(U, z)
    yield -1j * films.q2[0] / films.g[0] * U(z), -mp.diff(W, z)


@check("S3")
def _(rng):
    films = Films(rng)
    U, W = films.fields[1]
    delta, q, g = films.kappa[0] * films.q[0], films.q[0], films.g[0]
    slopes = mp.matrix([[0, -1j * g], [-1j * films.q2[0] / g, 0]])
    there = mp.expm(films.kappa[0] * slopes) * mp.matrix([U, W])
    yield films.fields[0][0], there[0]
    yield mp.cos(delta) * U - 1j * g * mp.sin(delta) / q * W, there[0]
    yield mp.cos(delta) * W - 1j * q * mp.sin(delta) / g * U, there[1]


@check("S4")
def _(rng):
    v = Films(rng).scaled(0)
    delta = v["kappa"] * v["Q"]
    yield (1 + v["E"]) / 2, v["f"] * mp.cos(delta)
    yield (1 - v["E"]) / (2 * v["Q"]), -1j * v["f"] * mp.sin(delta) / v["Q"]


@check("S5")
def _(rng):
    films = Films(rng)
    v = films.scaled(1)
    scale = mp.fprod(films.f[1:])
    U, W, C, sigma, g = (v[x] for x in ("u", "w", "C", "sigma", "g"))
    yield C * U + sigma * g * W, scale * films.fields[1][0]
    yield C * W + films.q2[1] * sigma / g * U, scale * films.fields[1][1]


@check("S6")
def _(rng):
    films = Films(rng)
    E, delta = films.f[0] ** 2, films.kappa[0] * films.q[0]
    size = abs(E)
    sine, twice = mp.sin(delta.real), mp.sin(2 * delta.real)
    yield (1 - size) + 2 * size * sine**2 - 1j * size * twice, 1 - E
    yield -mp.expm1(-2 * delta.imag), 1 - size


@check("S7")
def _(rng):
    films = Films(rng)
    x, q, whole = films.thickness[0] / films.wavelength, films.q[0], rng.randint(-9, 9)
    turned = mp.expj(2 * mp.pi * (x * q.real - whole)) * mp.exp(-2 * mp.pi * x * q.imag)
    yield mp.exp(2j * mp.pi * x * q), films.f[0]
    yield turned, films.f[0]


@check("S8")
def _(rng):
    films = Films(rng)
    angle = mp.acos(films.c)
    q2 = films.N[1] ** 2 - (films.N[0] * mp.sin(angle)) ** 2
    yield (films.N[1] ** 2 - films.N[0] ** 2) + films.q0**2, q2


@check("S9")
def _(rng):
    films = Films(rng)
    v = films.scaled(0)
    _, _, r, t = films.truth()
    U, W = (x * mp.fprod(films.f) for x in films.fields[0])
    t_U = 2 * films.q0 * mp.fprod(films.f) / (films.q0 * U + W)
    yield (films.q0 * U - W) / (films.q0 * U + W), r
    yield t_U * films.N[0] / films.N[-1] if films.p else t_U, t
    yield films.q0 * U + W, v["B"]


@check("S10")
def _(rng):
    films = Films(rng)
    v = films.scaled(1)
    U, W, E, sigma, g, Q = (v[x] for x in ("u", "w", "E", "sigma", "g", "Q"))
    M, h = films.q0 * U - W, g * films.q0 - Q
    near = [mp.fprod(films.f[1:]) * x for x in films.fields[1]]
    yield E * M + sigma * h * (Q / g * U + W), films.q0 * near[0] - near[1]
    yield (films.g[-1] * films.q0 - films.q[-1]) / films.g[-1], films.q0 - films.z[-1]


@check("S11")
def _(rng):
    films = Films(rng)
    N02, N2, q, q0 = films.N[0] ** 2, films.N[1] ** 2, films.q[0], films.q0
    g = N2 / N02
    yield -(N2 - N02) / (q0 + q), q0 - q
    yield (N2 - N02) * (g * q0**2 - films.K2) / (N02 * (g * q0 + q)), g * q0 - q


@check("S12")
def _(rng):
    films = Films(rng)
    (U, W), Z = films.fields[1], films.z[0]
    yield (films.q0 * U - W) - (films.q0 - Z) * U, Z * U - W


@check("S13")
def _(rng):
    films = Films(rng)
    U, W = films.fields[0]
    power = 4 * (films.q0 * U * mp.conj(W)).real
    yield 1 - power / abs(films.q0 * U + W) ** 2, films.truth()[0]


def admittances(films):
    per = [N**2 if films.p else 1 for N in films.N]
    return films.q0 / per[0], films.q[-1] / per[-1]


@check("S14")
def _(rng):
    films = Films(rng)
    _, T, _, t = films.truth()
    (y_0, y), v = admittances(films), films.scaled(0)
    t_U = t * films.N[-1] / films.N[0] if films.p else t
    yield abs(t_U) ** 2 * y.real / y_0.real, T
    own = 4 * abs(films.q0) ** 2 / y_0.real * y.real
    yield own * abs(mp.fprod(films.f) / v["B"]) ** 2, T


@check("S15")
def _(rng):
    films = Films(rng)
    q0, K2, N02 = films.q0, films.K2, films.N[0] ** 2
    rho = films.N[0].imag / films.N[0].real
    s = 4 * (q0.real + rho * q0.imag)
    yield s, 4 * abs(q0) ** 2 / q0.real
    p = s * abs(N02) ** 2 / (abs(q0) ** 2 + K2.real + rho * K2.imag)
    yield p, 4 * abs(q0) ** 2 / (q0 / N02).real


@check("S16")
def _(rng):
    for turn in range(8):
        q2 = mp.expj(mp.pi * (turn + rng.random()) / 4) * draw(rng, 0.1, 2)
        q = mp.expj(mp.pi / 4) * mp.sqrt(-1j * q2)
        yield q, forward_root(q2)
        if q2.imag >= 0:
            yield q, mp.sqrt(q2)


@check("S17")
def _(rng):
    N_0 = draw(rng, 1.4, 1.8)
    for s in (draw(rng, 0.1, 0.5), draw(rng, 0.8, 0.95)):  # below and above the critical angle

        def Q(epsilon, s=s):
            return mp.expj(mp.pi / 4) * mp.sqrt(-1j * (1 - (N_0 + 1j * epsilon) ** 2 * s**2))

        yield -1j * N_0 * s**2 / Q(0), slope(Q, 0)


@check("S18")
def _(rng):
    films = Films(rng)
    v = films.scaled(1)
    a, b, C, sigma, g = (v[x] for x in ("a", "b", "C", "sigma", "g"))
    there = [x * v["front"] * v["f"] for x in films.functional(2)]
    yield C * a + films.q2[1] * sigma / g * b, there[0]
    yield C * b + sigma * g * a, there[1]


def integral(films, i, function):
    return quadrature(lambda z: function(*films.inside(i, z)), films.kappa[i])


@check("S19")
def _(rng):
    films, i = Films(rng), 1
    q2, g, kappa = films.q2[i], films.g[i], films.kappa[i]
    by_q2 = slope(lambda x: films.solve(q2=(i, x))[1], q2)
    by_g = slope(lambda x: films.solve(g=(i, x), q2=(i, q2 / g * x))[1], g)  # at the same beta
    by_kappa = slope(lambda x: films.solve(kappa=(i, x))[1], kappa)
    b_u = integral(films, i, lambda field, of: of[1] * field[0])
    a_w = integral(films, i, lambda field, of: of[0] * field[1])
    yield -1j * b_u / g, by_q2
    yield -1j * a_w, by_g
    (u, w), (a, b) = films.inside(i, mp.mpf(0))
    yield -1j * (q2 / g * b * u + g * a * w), by_kappa


@check("S20")
def _(rng):
    films, i = Films(rng), 1
    q2, g = films.q2[i], films.g[i]
    by_q2 = slope(lambda x: films.solve(q2=(i, x))[2], q2)
    by_g = slope(lambda x: films.solve(g=(i, x), q2=(i, q2 / g * x))[2], g)
    factor = 2j * films.q0 / films.B**2
    yield factor / g * integral(films, i, lambda field, of: field[0] ** 2), by_q2
    yield -factor * integral(films, i, lambda field, of: field[1] ** 2), by_g


@check("S21")
def _(rng):
    films = Films(rng)
    (u, w), (_, b) = films.fields[0], films.functional(3)
    q0, B = films.q0, films.B
    by_q0 = [slope(lambda x, i=i: films.solve(q0=x)[i], q0) for i in (1, 2)]
    by_z = [slope(lambda x, i=i: films.solve(z_far=x)[i], films.z[-1]) for i in (1, 2)]
    yield 2 * u * w / B**2, by_q0[1]
    yield -2 * q0 / B**2, by_z[1]
    yield -u / B, -by_q0[0] / B
    yield -b / B, -by_z[0] / B


@check("S22")
def _(rng):
    films = Films(rng)
    (u, w), Z, Q, zeta = films.fields[1], films.z[0], films.q[0], draw(rng, 0, 1)
    ahead, back = (Z * u + w) * mp.exp(-1j * Q * zeta), (Z * u - w) * mp.exp(1j * Q * zeta)
    field, _ = films.inside(0, zeta)
    yield (ahead + back) / (2 * Z), field[0]
    yield (ahead - back) / 2, field[1]


def layer_and_slopes(rng, of):
    """The quantities of a layer, and the derivatives of r or log(1 / B) by Q^2, g and kappa."""
    films, i = Films(rng), rng.randrange(3)

    def value(**replaced):
        _, B, r = films.solve(**replaced)
        return r if of == "r" else mp.log(1 / B)

    slopes = [
        slope(lambda x, name=name, at=at: value(**{name: (i, x)}), at[i])
        for name, at in (("q2", films.q2), ("g", films.g), ("kappa", films.kappa))
    ]
    return films, films.scaled(i), slopes


@check("S23")
def _(rng):
    films, v, (by_q2, _, _) = layer_and_slopes(rng, "r")
    g, Q, E, S, D, sigma, kappa = (v[x] for x in ("g", "Q", "E", "S", "D", "sigma", "kappa"))
    G = films.q0 * v["front"] ** 2 / v["B"] ** 2
    yield g * G / (2 * Q**2) * (2j * kappa * E * S * D - sigma * (S**2 + E * D**2)), by_q2


@check("S24")
def _(rng):
    films, v, (_, by_g, by_kappa) = layer_and_slopes(rng, "r")
    E, S, D = v["E"], v["S"], v["D"]
    G = films.q0 * v["front"] ** 2 / v["B"] ** 2
    yield G * v["sigma"] * (S**2 + E * D**2), by_g
    yield 2j * v["g"] * G * E * S * D, by_kappa


def along_and_across(films, v):
    """The script A and X, and B in the units of the layer's front."""
    plus, minus = v["Z"] * v["b"] + v["a"], v["Z"] * v["b"] - v["a"]
    along = plus * v["S"] + v["E"] * minus * v["D"]
    return along, 1j * v["sigma"] * (plus * v["D"] + minus * v["S"]), v["B"]


@check("S25")
def _(rng):
    films, v, (by_q2, _, _) = layer_and_slopes(rng, "t")
    along, across, B = along_and_across(films, v)
    yield 1j * v["g"] / (4 * B * v["Q"] ** 2) * (v["kappa"] * along + across), by_q2


@check("S26")
def _(rng):
    films, v, (_, by_g, by_kappa) = layer_and_slopes(rng, "t")
    along, across, B = along_and_across(films, v)
    yield -1j / (2 * B) * across, by_g
    yield 1j * v["g"] / (2 * B) * along, by_kappa


def thin_sine(delta):
    return (1 - mp.sin(2 * delta) / (2 * delta)) / (2 * delta**2)


@check("S27")
def _(rng):
    films, i = Films(rng), 2  # the last layer: its fields have no factors of layers behind
    v = films.scaled(i)
    u, w, g, E, sigma, kappa = (v[x] for x in ("u", "w", "g", "E", "sigma", "kappa"))
    cosine = (kappa * E + 1j * sigma * v["C"]) / 2
    sine = kappa**3 * E * thin_sine(kappa * v["Q"])
    truth = E * integral(films, i, lambda field, of: field[0] ** 2)
    yield cosine * u**2 - sine * (g * w) ** 2 + 1j * sigma**2 * g * u * w, truth


@check("S28")
def _(rng):
    delta = mp.mpc(draw(rng, 0.1, 1), draw(rng, 0, 1))
    terms = [(-1) ** j * 2 * mp.mpf(4) ** j / mp.factorial(2 * j + 3) for j in range(40)]
    yield mp.fsum(x * delta ** (2 * j) for j, x in enumerate(terms)), thin_sine(delta)


@check("S29")
def _(rng):
    v = Films(rng).scaled(0)
    f, Q, kappa, delta = v["f"], v["Q"], v["kappa"], v["kappa"] * v["Q"]

    def cosine(q2, x):
        return f * mp.cos(x * mp.sqrt(q2))

    def sine(q2, x):
        return -1j * f * mp.sin(x * mp.sqrt(q2)) / mp.sqrt(q2)

    at = Q**2, kappa
    series = (mp.cos(delta) - mp.sin(delta) / delta) / delta**2
    yield -1j * v["sigma"] * kappa / 2, slope(lambda x: cosine(x, kappa), at[0])
    yield -1j * v["sigma"] * Q**2, slope(lambda x: cosine(Q**2, x), kappa)
    yield -1j * kappa**3 / 2 * f * series, slope(lambda x: sine(x, kappa), at[0])
    yield -1j * v["C"], slope(lambda x: sine(Q**2, x), kappa)


@check("S30")
def _(rng):
    films = Films(rng)
    (q_i, q_j), sigma = films.q[:2], draw(rng, 0.05, 0.2)  # k_0 sigma_r

    def mean(q):  # over heights of a Gaussian, by the trapezoidal rule, to exp(-300)
        heights = [mp.mpf(x) / 4 for x in range(-72, 73)]
        return mp.fsum(mp.exp(1j * q * sigma * x - x**2 / 2) for x in heights)

    yield mp.exp(-2 * sigma**2 * q_i * q_j), mean(q_i + q_j) / mean(q_i - q_j)


def factors(w_r, z_i, z_j):
    return (w_r - 1) * (z_i - z_j) / (2 * z_i), (w_r - 1) * (z_j - z_i) / (2 * z_j)


@check("S31")
def _(rng):
    films = Films(rng)
    z_i, z_j, w_r = films.z[0], films.z[1], mp.mpc(draw(rng, 0.2, 1), draw(rng, -0.1, 0.1))
    ahead, back = mp.mpc(1, draw(rng, 0, 1)), mp.mpc(draw(rng, 0, 1), 1)
    r, per_t = (z_i - z_j) / (z_i + z_j) * w_r, (z_i + z_j) / (2 * z_i)
    ahead_i, back_i = (ahead + r * back) * per_t, (r * ahead + back) * per_t
    mu, nu = factors(w_r, z_i, z_j)
    yield (1 + mu) * (ahead + back), ahead_i + back_i
    yield (1 + nu) * z_j * (ahead - back), z_i * (ahead_i - back_i)


@check("S32")
def _(rng):
    films = Films(rng, layers=1)
    rough = [mp.mpc(draw(rng, -0.3, 0), draw(rng, -0.1, 0.1)) for _ in range(4)]

    def solve(values):
        mu_0, nu_0, mu_1, nu_1 = values
        below_1 = films.fields[-1]
        above_1 = (1 + mu_1) * below_1[0], (1 + nu_1) * below_1[1]
        below_0 = apply(films.matrices[0], above_1)
        above_0 = (1 + mu_0) * below_0[0], (1 + nu_0) * below_0[1]
        B = films.q0 * above_0[0] + above_0[1]
        return below_1, below_0, B, (films.q0 * above_0[0] - above_0[1]) / B

    below_1, below_0, B, _ = solve(rough)
    mu_0, nu_0, _, _ = rough
    front = films.q0, mp.mpc(1)
    inner = apply_transposed(films.matrices[0], ((1 + mu_0) * front[0], (1 + nu_0) * front[1]))
    for at, (a, b), (u, w), det in (
        (0, front, below_0, 1), (2, inner, below_1, (1 + mu_0) * (1 + nu_0)),
    ):  # fmt: skip
        mu, nu = rough[at : at + 2]
        by = [
            [slope(lambda x, i=i, j=j: solve([*rough[:i], x, *rough[i + 1 :]])[j], rough[i])
             for i in (at, at + 1)]
            for j in (2, 3)
        ]  # fmt: skip
        yield a * u, by[0][0]
        yield b * w, by[0][1]
        factor = 2 * films.q0 * det / B**2 * u * w
        yield factor * (1 + nu), by[1][0]
        yield -factor * (1 + mu), by[1][1]


@check("S33")
def _(rng):
    films = Films(rng)
    films.g = [mp.mpc(1)] * 4
    Y, delta = films.q[0], films.q[0] * films.kappa[0]
    there = mp.mpc(draw(rng, 1, 2), draw(rng, 0, 1))
    U, W = apply(through(films.q2[0], mp.mpc(1), films.kappa[0]), (1, there))
    yield Y * (there - 1j * Y * mp.tan(delta)) / (Y - 1j * there * mp.tan(delta)), W / U


def airy(films):
    """r, t of tangential fields, and r_1, G, p, r and t behind, of the first boundary."""
    Y = [films.q0, *films.q]
    if films.p:
        Y = [y / N**2 for y, N in zip(Y, films.N, strict=True)]
    own = [(y - y_next) / (y + y_next) for y, y_next in itertools.pairwise(Y)]
    r, t, parts = own[-1], 1 + own[-1], None
    for r_1, kappa, q in reversed(list(zip(own[:-1], films.kappa, films.q[:-1], strict=True))):
        p = 1j * kappa * q
        G = r * mp.exp(2 * p)
        parts = r_1, G, p, r, t
        r, t = (r_1 + G) / (1 + r_1 * G), (1 + r_1) * mp.exp(p) * t / (1 + r_1 * G)
    return r, t, parts


@check("S34")
def _(rng):
    films = Films(rng)
    r, t, _ = airy(films)
    truth = films.truth()
    yield r, truth[2]
    yield t * films.N[0] / films.N[-1] if films.p else t, truth[3]


@check("S35")
def _(rng):
    _, _, (r_1, G, p, r, _) = airy(Films(rng))

    def step(r_1, G):
        return (r_1 + G) / (1 + r_1 * G)

    gamma = 1 / (1 + r_1 * G)
    yield (1 - G**2) * gamma**2, slope(lambda x: step(x, G), r_1)
    yield (1 - r_1**2) * gamma**2, slope(lambda x: step(r_1, x), G)
    yield 2 * G, slope(lambda x: r * mp.exp(2 * x), p)


@check("S36")
def _(rng):
    _, _, (r_1, _, p, r, t) = airy(Films(rng))
    moved = [mp.mpc(draw(rng, -1, 1), draw(rng, -1, 1)) for _ in range(4)]
    d_r1, d_p, d_r, d_t = moved

    def log_t(x):
        s_1, q, s, behind = (z + x * d for z, d in zip((r_1, p, r, t), moved, strict=True))
        return mp.log((1 + s_1) * mp.exp(q) * behind / (1 + s_1 * s * mp.exp(2 * q)))

    G = r * mp.exp(2 * p)
    dG = d_r * mp.exp(2 * p) + 2 * G * d_p
    gamma = 1 / (1 + r_1 * G)
    printed = d_r1 / (1 + r_1) + d_p + d_t / t - gamma * (G * d_r1 + r_1 * dG)
    yield printed, slope(log_t, 0)


@check("S37")
def _(rng):
    films = Films(rng)
    (Y, other), (dY, d_other) = films.q[:2], films.q[2:]

    def r_1(x):
        return (Y + x * dY - other - x * d_other) / (Y + x * dY + other + x * d_other)

    by_x = slope(r_1, 0)
    yield 2 * (other * dY - Y * d_other) / (Y + other) ** 2, by_x
    yield (other / Y * dY - d_other) / (Y + other), by_x / (1 + r_1(0))


@check("S38")
def _(rng):
    (N_o, N_e), K2 = Films(rng).N[1:3], draw(rng, 0, 2)
    Q2 = N_o**2 * (1 - K2 / N_e**2)
    yield (N_o**2 - Q2) * (N_e**2 - K2), K2 * Q2
    yield Q2, N_o**2 - N_o**2 * K2 / N_e**2
    yield Q2, N_o**2 - K2 + K2 * (N_e**2 - N_o**2) / N_e**2


@check("S39")
def _(rng):
    films = Films(rng)
    (N_0, N_o, N_e), Q_02, K2 = films.N[:3], films.q0**2, films.K2
    g = N_o**2 / N_0**2
    gap = (N_o**2 - N_0**2) * Q_02 / N_0**2 - (N_e**2 - N_0**2) * K2 / N_e**2
    yield g * gap, g**2 * Q_02 - N_o**2 * (1 - K2 / N_e**2)


# Absorption ----------------------------------------------------------------------------------


@check("A1")
def _(rng):
    films, i = Films(rng), 1
    zeta, (t, m) = draw(rng, 0, 1) * films.kappa[i], films.weights(i)
    (U, W), _ = films.inside(i, zeta)

    def power(x):
        return films.flux(films.inside(i, x)[0])

    yield t * abs(U) ** 2 + m * abs(W) ** 2, slope(power, zeta)


@check("A2")
def _(rng):
    films = Films(rng)
    N, g = films.N[1], films.N[1] ** 2 / films.N[0] ** 2
    # of beta and g in (S2): Re(-i beta |U|^2 + i conj(g) |W|^2), over N_0^2 for p
    yield films.q2[0].imag, (-1j * films.q2[0]).real
    yield -(films.K2 / N**2).imag, (-1j * films.q2[0] / g / films.N[0] ** 2).real
    yield (N**2).imag / abs(films.N[0] ** 2) ** 2, (1j * mp.conj(g) / films.N[0] ** 2).real


def decaying_and_beating(films, i):
    Q, kappa, E = films.q[i], films.kappa[i], films.f[i] ** 2
    x = Q.real * kappa
    beating = (E.imag + 2j * abs(E) * mp.sin(x) ** 2) / (2 * Q.real)
    return (1 - abs(E)) / (2 * Q.imag), beating


@check("A3")
def _(rng):
    films, i = Films(rng), 1
    H, V = decaying_and_beating(films, i)
    Q, end = films.q[i], films.kappa[i]
    yield H, quadrature(lambda z: mp.exp(-2 * Q.imag * z), end)
    yield V, abs(films.f[i]) ** 2 * quadrature(lambda z: mp.expj(2 * Q.real * z), end)


@check("A4")
def _(rng):
    films, i = Films(rng), 2  # the last layer: its fields have no factors of layers behind
    v, (t, m), (H, V) = films.scaled(i), films.weights(i), decaying_and_beating(films, i)
    S, D, Z2 = v["S"], v["D"], abs(v["Z"]) ** 2
    waves = (t + m * Z2) * (abs(S) ** 2 + abs(v["E"]) * abs(D) ** 2) * H
    waves += 2 * (t - m * Z2) * (mp.conj(S) * D * V).real
    yield waves / abs(2 * v["Z"]) ** 2, abs(v["f"]) ** 2 * films.loss(i)


def thin_products(films):
    """The integrals of |cos|^2, |sin / Q|^2 and -i conj(cos) sin / Q, by quadrature."""
    Q = films.q[0]
    cosine, sine = lambda z: mp.cos(Q * z), lambda z: mp.sin(Q * z) / Q
    return [
        quadrature(of, films.kappa[0])
        for of in (
            lambda z: abs(cosine(z)) ** 2,
            lambda z: abs(sine(z)) ** 2,
            lambda z: -1j * mp.conj(cosine(z)) * sine(z),
        )
    ]


@check("A5")
def _(rng):
    films = Films(rng)
    delta, Q, kappa = films.kappa[0] * films.q[0], films.q[0], films.kappa[0]
    by_y, by_x = (
        part(2 * z) / (2 * z) for part, z in ((mp.sinh, delta.imag), (mp.sin, delta.real))
    )
    cosine2, sine2, _ = thin_products(films)
    yield kappa / 2 * (by_y + by_x), cosine2
    yield kappa / (2 * abs(Q) ** 2) * (by_y - by_x), sine2


@check("A6")
def _(rng):
    films = Films(rng)
    delta, Q, kappa = films.kappa[0] * films.q[0], films.q[0], films.kappa[0]
    x, y = delta.real, delta.imag
    bracket = (1 - mp.cos(2 * x)) / x + 1j * (mp.cosh(2 * y) - 1) / y
    yield -1j * kappa / (4 * Q) * bracket, thin_products(films)[2]


def c_and_d(delta, j):
    x, y = delta.real, delta.imag
    even, odd = y ** (2 * j), (-1) ** j * x ** (2 * j)
    return even + odd, (even - odd) / abs(delta) ** 2


@check("A7")
def _(rng):
    delta = mp.mpc(draw(rng, 0.1, 1), draw(rng, 0.1, 1))
    z = delta**2
    for i, start in enumerate(((2, -z.real), (0, 1))):
        yield start[0], c_and_d(delta, 0)[i]
        yield start[1], c_and_d(delta, 1)[i]
        for j in (1, 2, 5):
            before, here, after = (c_and_d(delta, j + k)[i] for k in (-1, 0, 1))
            yield -z.real * here + z.imag**2 / 4 * before, after


@check("A8")
def _(rng):
    films = Films(rng)
    kappa, delta = films.kappa[0], films.kappa[0] * films.q[0]
    terms = [(mp.mpf(4) ** j / mp.factorial(2 * j + 1), *c_and_d(delta, j)) for j in range(80)]
    cosine2, sine2, _ = thin_products(films)
    yield kappa / 2 * mp.fsum(x * c for x, c, _ in terms), cosine2
    yield kappa**3 / 2 * mp.fsum(x * d for x, _, d in terms[1:]), sine2


@check("A9")
def _(rng):
    films = Films(rng)
    kappa, delta = films.kappa[0], films.kappa[0] * films.q[0]
    even = [mp.mpf(4) ** j / mp.factorial(2 * j) for j in range(80)]
    d = [c_and_d(delta, j)[1] for j in range(80)]
    re = kappa**2 / 8 * (delta**2).imag * mp.fsum(even[j] * d[j - 1] for j in range(1, 80))
    im = -(kappa**2) / 4 * mp.fsum(even[j] * d[j] for j in range(1, 80))
    yield mp.mpc(re, im), thin_products(films)[2]


@check("A10")
def _(rng):
    films = Films(rng)
    v = films.scaled(1)
    U, W, C, sigma, g, q2 = (v[x] for x in ("u", "w", "C", "sigma", "g", "Q"))
    q2, product = q2**2, W * mp.conj(U)
    B = abs(sigma) ** 2 * q2 * mp.conj(g) / g
    near = [mp.fprod(films.f[1:]) * x for x in films.fields[1]]
    printed = (abs(C) ** 2 + B.real) * product.real + B.imag * product.imag
    printed += (mp.conj(C) * q2 * sigma / g).real * abs(U) ** 2
    printed += (C * mp.conj(sigma * g)).real * abs(W) ** 2
    yield printed, (near[1] * mp.conj(near[0])).real


@check("A11")
def _(rng):
    v = Films(rng).scaled(0)
    Q, E, C, sigma = (v[x] for x in ("Q", "E", "C", "sigma"))
    growth = abs(v["f"]) ** 2 * mp.sinh(2 * v["kappa"] * Q.imag)
    yield (Q.real * growth + Q.imag * E.imag) / 2, (mp.conj(C) * Q**2 * sigma).real
    yield (Q.real * growth - Q.imag * E.imag) / (2 * abs(Q) ** 2), (C * mp.conj(sigma)).real


@check("A12")
def _(rng):
    v = Films(rng).scaled(0)
    Q, E, y = v["Q"], v["E"], v["kappa"] * v["Q"].imag
    f2 = abs(v["f"]) ** 2
    carried = (Q.real**2 * f2 * mp.cosh(2 * y) + Q.imag**2 * E.real) / abs(Q) ** 2
    yield carried, abs(v["C"]) ** 2 + abs(v["sigma"]) ** 2 * (Q**2).real
    yield (1 - abs(E)) * (1 + abs(E)) / 2, f2 * mp.sinh(2 * y)


@check("A13")
def _(rng):
    v = Films(rng).scaled(0)
    y, f2 = v["kappa"] * v["Q"].imag, abs(v["f"]) ** 2
    yield 1 - f2 * mp.sinh(2 * y), f2 * mp.cosh(2 * y)


@check("A14")
def _(rng):
    films = Films(rng)
    R, T, r, _ = films.truth()
    y_0, _ = admittances(films)
    incident = y_0.real * abs(films.B / (2 * films.q0)) ** 2
    total = R + T
    for i in range(3):
        total += films.loss(i) / incident
    yield 1 + 2 * r.imag * y_0.imag / y_0.real, total


def absorbed_slope(films, layer, changed):
    """The derivative of I / |B|^2 of one layer by the thickness of another one."""

    def value(x):
        fields, B, _ = films.solve(kappa=(changed, x))
        return films.absorbed(layer, fields) / abs(B) ** 2

    return slope(value, films.kappa[changed])


@check("A15")
def _(rng):
    films, layer, changed = Films(rng), 2, 0
    by_kappa = slope(lambda x: films.solve(kappa=(changed, x))[1], films.kappa[changed])
    here = films.absorbed(layer, films.fields) / abs(films.B) ** 2
    yield 2 * here * (-by_kappa / films.B).real, absorbed_slope(films, layer, changed)


def sent_back(films, changed):
    return slope(lambda x: films.solve(kappa=(changed, x))[2], films.kappa[changed]) / (
        2 * films.q0
    )


@check("A16")
def _(rng):
    films, changed = Films(rng), 2
    for depth in (0, 1, 2):
        a, b = films.functional(depth)
        for i, of in enumerate((b, -a)):

            def field(x, depth=depth, i=i):
                fields, B, _ = films.solve(kappa=(changed, x))
                return fields[depth][i] / B

            yield sent_back(films, changed) * of, slope(field, films.kappa[changed])


@check("A17")
def _(rng):
    films, layer, changed = Films(rng), 0, 2
    t, m = films.weights(layer)

    def product(field, of):
        return t * mp.conj(field[0]) * of[1] - m * mp.conj(field[1]) * of[0]

    through_layer = integral(films, layer, product)
    printed = 2 * (sent_back(films, changed) / mp.conj(films.B) * through_layer).real
    yield printed, absorbed_slope(films, layer, changed)


@check("A18")
def _(rng):
    films = Films(rng)
    v = films.scaled(1)
    Z, S, D, a, b = (v[x] for x in ("Z", "S", "D", "a", "b"))
    front = mp.fprod(films.f)
    yield S * (a + b * Z) + v["E"] * D * (a - b * Z), 2 * Z * films.B * front
    u, w = v["u"], v["w"]
    yield 2 * u * w / S**2, slope(lambda x: (x * u - w) / (x * u + w), Z)


# Films and thick layers together -------------------------------------------------------------


class Packets:
    """A packet of films, a thick layer and films behind it, for s and p, by textbook matrices."""

    def __init__(self, rng):
        first, second = Films(rng, lossless_first=True, layers=1), Films(rng, layers=1)
        self.c, self.N = first.c, [*first.N[:2], first.N[2], second.N[1], second.N[2]]
        self.N[2] = mp.mpc(self.N[2].real, draw(rng, 0.01, 0.05))
        self.K2 = self.N[0] ** 2 * (1 - self.c**2)
        self.q = [self.N[0] * self.c, *(forward_root(N**2 - self.K2) for N in self.N[1:])]
        self.delta = [2 * q * draw(rng, 0.2, 0.9) for q in self.q[1:4]]
        self.P = abs(mp.exp(1j * self.delta[1])) ** 2

    def admittance(self, p):
        return [q / (N**2 if p else 1) for q, N in zip(self.q, self.N, strict=True)]

    def amplitudes(self, p, media, turned=0):
        """r, t of tangential fields, and the fields (U, W) at the front, of unit transmitted U."""
        y = self.admittance(p)
        U, W = mp.mpc(1), y[media[-1]]
        for i in reversed(media[1:-1]):
            delta = self.delta[i - 1] + (turned if i == 2 else 0)
            sine = mp.sin(delta)
            U, W = (
                mp.cos(delta) * U - 1j * sine / y[i] * W,
                mp.cos(delta) * W - 1j * sine * y[i] * U,
            )
        front = y[media[0]]
        return (front * U - W) / (front * U + W), 2 * front / (front * U + W), (U, W)

    def powers(self, p, media):
        """R and T as ratios of single waves."""
        y = self.admittance(p)
        r, t, _ = self.amplitudes(p, media)
        return abs(r) ** 2, abs(t) ** 2 * y[media[-1]].real / y[media[0]].real


def slab(rng):
    b = Boundary(rng)
    b.at(b.c, b.n + 1, draw(rng, 0.001, 0.05), b.m)
    wavelength, thickness = draw(rng, 0.4, 0.8), draw(rng, 0.5, 2)
    return b, wavelength, thickness, mp.exp(-4 * mp.pi * thickness / wavelength * b.b)


@check("M1")
def _(rng):
    b, wavelength, thickness, P = slab(rng)
    yield P, abs(mp.exp(2j * mp.pi / wavelength * b.Q * thickness)) ** 2


@check("M2")
def _(rng):
    b, _, _, P = slab(rng)
    R_1, T_1 = b.R_s, b.T_s
    inside = [T_1 * P * (R_1 * P) ** j for j in range(600)]  # what meets a face, the j-th time
    T = T_1**2 * P / (1 - (R_1 * P) ** 2)
    yield T, mp.fsum(T_1 * x for x in inside[::2])
    yield R_1 + R_1 * P * T, R_1 + mp.fsum(T_1 * x for x in inside[1::2])


@check("M3")
def _(rng):
    b, _, _, P = slab(rng)
    yield b.T_s * (1 + b.R_s) + b.R_s**2 * (1 - P**2), 1 - (b.R_s * P) ** 2
    yield -mp.expm1(2 * mp.log(P)), 1 - P**2


@check("M4")
def _(rng):
    b, _, _, _ = slab(rng)
    t_1, t_2 = 2 * b.C / (b.C + b.Q), 2 * b.Q / (b.C + b.Q)
    yield b.T_s**2 * abs(b.Q) ** 2 / b.a**2, abs(t_1 * t_2) ** 2
    y_0, y = b.c / b.m, b.Q / b.N**2
    t_1, t_2 = 2 * y_0 / (y_0 + y), 2 * y / (y_0 + y)
    yield b.T_p**2 * abs(y) ** 2 / y.real**2, abs(t_1 * t_2) ** 2


def packet_powers(rng):
    """R, R', T, P and R_next, of any passive packet."""
    R, R_back, R_next = (draw(rng, 0.1, 0.6) for _ in range(3))
    return R, R_back, draw(rng, 0.1, 0.3), draw(rng, 0.3, 0.99), R_next


@check("M5")
def _(rng):
    R, R_back, T, P, R_next = packet_powers(rng)
    down = [T * (P**2 * R_next * R_back) ** j for j in range(400)]
    bottom = 1 - R_back * P**2 * R_next
    yield R + T**2 * P**2 * R_next / bottom, R + mp.fsum(x * P**2 * R_next * T for x in down)
    yield T / bottom, mp.fsum(down)


@check("M6")
def _(rng):
    _, R_back, _, P, R_next = packet_powers(rng)
    yield (
        (1 - R_back) + R_back * ((1 - P) * (1 + P) + P**2 * (1 - R_next)),
        1 - R_back * P**2 * R_next,
    )


@check("M7")
def _(rng):
    _, R_back, T, P, R_next = packet_powers(rng)
    light, lost = T, mp.mpf(0)
    for _ in range(400):  # down, up, and down again
        lost += light * (1 - P) + light * P * R_next * (1 - P)
        light *= P**2 * R_next * R_back
    yield T / (1 - R_back * P**2 * R_next) * (1 - P) * (1 + P * R_next), lost


@check("M8")
def _(rng):
    packets = Packets(rng)
    for p in (False, True):
        y = packets.admittance(p)[2]
        _, T = packets.powers(p, [2, 1, 0])
        _, way_in = packets.powers(p, [0, 1, 2])
        yield T * y.real**2 / abs(y) ** 2, way_in


@check("M9")
def _(rng):
    packets = Packets(rng)
    for p in (False, True):
        y = packets.admittance(p)[2]
        r, t, (U, W) = packets.amplitudes(p, [2, 3, 4])
        crossing = (W * mp.conj(U)).real * abs(t) ** 2 / y.real  # T and all A, by the fields
        left = 1 - abs(r) ** 2 - crossing * y.real**2 / abs(y) ** 2
        own = y.imag * (1 - abs(r) ** 2) - 2 * y.real * r.imag
        yield y.imag / abs(y) ** 2 * own, left


WAYS = ((False, False), (True, True), (True, False))  # s, p, and p with s


def sums(packets):
    """Of all ways the printed (M10) and (M11), each with the mean over the thick layer's phase."""
    first, back, below = (
        [packets.amplitudes(p, media) for p in (False, True)]
        for media in ([0, 1, 2], [2, 1, 0], [2, 3, 4])
    )
    count = 96
    turned = [
        [packets.amplitudes(p, [0, 1, 2, 3, 4], mp.pi * j / count) for p in (False, True)]
        for j in range(count)
    ]
    for a, b in WAYS:
        # of r and of t: x_a conj(x_b)
        own, returned, behind = (
            [x * mp.conj(y) for x, y in zip(z[a][:2], z[b][:2], strict=True)]
            for z in (first, back, below)
        )
        mean = [mp.fsum(z[a][i] * mp.conj(z[b][i]) for z in turned) / count for i in range(2)]
        bottom = 1 - returned[0] * packets.P**2 * behind[0]
        r = own[0] + own[1] * returned[1] * packets.P**2 * behind[0] / bottom
        yield (r, mean[0]), (own[1] * packets.P * behind[1] / bottom, mean[1])


@check("M10")
def _(rng):
    for of_r, _ in sums(Packets(rng)):
        yield of_r


@check("M11")
def _(rng):
    packets = Packets(rng)
    for _, of_t in sums(packets):
        yield of_t
    for p in (False, True):
        y = packets.admittance(p)
        t, back = (packets.amplitudes(p, media)[1] for media in ([0, 1, 2], [2, 1, 0]))
        yield t * y[2] / y[0], back


# The code -------------------------------------------------------------------------------------


def close(found, expected):
    """Within 1e-12, far above the errors of the code and far below those of a wrong formula."""
    expected = np.array([[complex(x) for x in row] for row in expected])
    np.testing.assert_allclose(np.asarray(found), expected, rtol=1e-12, atol=1e-14)


def test_functions_of_one_boundary_give_these_values():
    rng = random.Random(1)
    drawn = [Boundary(rng) for _ in range(4)]
    arguments = [
        jnp.asarray([float(x) for x in z]) for z in zip(*(b.arguments for b in drawn), strict=True)
    ]

    @jax.jit
    def found(*of):
        more = reflectance(*of), polarization.ellipsometric_ratio(*of)
        return jnp.stack([*amplitudes(*of), *powers(*of), *more], axis=1)

    def printed(b):
        R_s, s2, p2, x2 = abs(b.D) ** 2 / abs(b.S) ** 4, abs(b.S) ** 2, abs(b.P) ** 2, abs(b.X) ** 2
        yield -b.D / b.S**2
        yield b.D * b.Y * b.m**2 / (b.S * b.X) ** 2
        yield 2 * b.C / b.S
        yield 2 * b.C * b.N * b.m / (b.S * b.X)
        yield R_s
        yield abs(b.D * b.Y) ** 2 / p2**2
        yield 4 * b.C * b.a / s2
        yield 4 * b.C * b.a * (abs(b.Q) ** 2 + b.sigma) / p2
        yield R_s * b.U / x2
        yield -(b.m**2) * b.Y / b.X**2

    with mp.workdps(30):
        close(found(*arguments), map(printed, drawn))


def as_floats(rows):
    return jnp.asarray([[complex(x) for x in row] for row in zip(*rows, strict=True)])


def test_stack_gives_these_values():
    rng = random.Random(2)
    drawn = [Films(rng) for _ in range(4)]
    of = [
        jnp.asarray([float(x) for x in z])
        for z in zip(*((f.c, f.wavelength) for f in drawn), strict=True)
    ]
    thickness = as_floats([f.thickness for f in drawn]).real
    found = layers.stack(
        of[0], as_floats([f.N for f in drawn]), thickness_um=thickness, wavelength_um=of[1]
    )
    s, p = (
        jnp.stack([found[i], found[2 + i], found[4 + i], found[6 + i], *found[8 + i]])
        for i in range(2)
    )
    with mp.workdps(30):
        for i, f in enumerate(drawn):
            y_0, _ = admittances(f)
            incident = y_0.real * abs(f.B / (2 * f.q0)) ** 2
            R, T, r, t = f.truth()
            expected = [R, T, r, t, *(f.loss(j) / incident for j in range(3))]
            close((p if f.p else s)[:, i : i + 1], [[x] for x in expected])


def test_fast_tier_with_a_thick_layer_gives_these_values():
    packets = Packets(random.Random(3))
    thickness = [
        float((delta / (2 * mp.pi * q)).real)
        for delta, q in zip(packets.delta, packets.q[1:4], strict=True)
    ]
    found = layers.stack(
        float(packets.c), [complex(N) for N in packets.N], thickness_um=thickness,
        wavelength_um=1.0, coherent=(True, False, True), exact=False,
    )  # fmt: skip
    with mp.workdps(30):
        y = [packets.admittance(p) for p in (False, True)]
        (R_s, T_s), (R_p, T_p), (cross, _) = ([of_r[0], of_t[0]] for of_r, of_t in sums(packets))
        T = [t * of[-1].real / of[0].real for t, of in zip((T_s, T_p), y, strict=True)]
        close([[found.R_s, found.R_p, found.cross, found.T_s, found.T_p]], [[R_s, R_p, cross, *T]])


def test_every_formula_has_one_number_and_one_check():
    numbers = []
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        for formula in re.findall(r"^\$\$\n(.*?)^\$\$$", text, re.DOTALL | re.MULTILINE):
            tags = re.findall(r"\\tag\{(\w+)\}", formula)
            assert len(tags) == 1, f"{page.name}: {formula}"
            numbers += tags
            # GitHub takes these for Markdown: \, for a comma, a sign in front of a line for a list
            assert not re.search(r"\\[^a-zA-Z]|^[-+=] ", formula, re.MULTILINE), formula
    assert sorted(numbers) == sorted(CHECKS)


@pytest.mark.parametrize("number", list(CHECKS))
def test_equation(number):
    rng = random.Random(number)
    with mp.workdps(45):
        for _ in range(2):
            for i, (printed, expected) in enumerate(CHECKS[number](rng)):
                error = abs(printed - expected)
                assert error <= mp.mpf(10) ** -35 * abs(expected), (
                    f"pair {i}: {printed}, {expected}"
                )
