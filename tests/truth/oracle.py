"""The Fresnel equations as textbooks print them, in 100 decimal digits.

Nothing is rearranged: the quotients of the amplitudes, their squared moduli, Poynting's ratio for
T, and the quotient rule for derivatives. Inputs are the exact values of binary floats,
or mpmath numbers.
"""

import functools

import mpmath as mp

DIGITS = 100


def _medium(c, n, k, m):
    c, n, k, m = (x if isinstance(x, mp.mpf) else mp.mpf(float(x)) for x in (c, n, k, m))
    N = mp.mpc(n, k)
    Q = mp.sqrt(N * N - m * m * (1 - c * c))  # N cos(theta_t), Im >= 0
    return c, N, m, Q


@functools.lru_cache(100_000)
def amplitudes(c, n, k, m):
    """r_s, r_p, t_s, t_p."""
    with mp.workdps(DIGITS):
        c, N, m, Q = _medium(c, n, k, m)
        s, p = m * c + Q, N * N * c + m * Q
        if s == 0:  # matched media at grazing incidence: the limit along matched media
            return mp.mpc(0), mp.mpc(0), mp.mpc(1), mp.mpc(1)
        return (m * c - Q) / s, (N * N * c - m * Q) / p, 2 * m * c / s, 2 * m * c * N / p


@functools.lru_cache(100_000)
def powers(c, n, k, m):
    """R_s, R_p, T_s, T_p; T is the ratio of the Poynting vectors' normal components."""
    with mp.workdps(DIGITS):
        r_s, r_p, t_s, t_p = amplitudes(c, n, k, m)
        c, N, m, Q = _medium(c, n, k, m)
        if m * c + Q == 0:
            return mp.mpf(0), mp.mpf(0), mp.mpf(1), mp.mpf(1)
        T_s = abs(t_s) ** 2 * Q.real / (m * c)
        T_p = abs(t_p) ** 2 * mp.re(mp.conj(N) * Q / N) / (m * c)
        return abs(r_s) ** 2, abs(r_p) ** 2, T_s, T_p


def reflectance(c, n, k, m):
    """R of unpolarized light."""
    with mp.workdps(DIGITS):
        r_s, r_p, *_ = amplitudes(c, n, k, m)
        return (abs(r_s) ** 2 + abs(r_p) ** 2) / 2


@functools.lru_cache(100_000)
def amplitude_gradients(c, n, k, m):
    """For each of r_s, r_p, t_s, t_p its derivatives with respect to (c, n, k, m).

    None where Q = 0, where they are infinite.
    """
    with mp.workdps(DIGITS):
        c, N, m, Q = _medium(c, n, k, m)
        if Q == 0:
            return None
        gradients = [[], [], [], []]
        for dc, dN, dm in ((1, 0, 0), (0, 1, 0), (0, mp.mpc(0, 1), 0), (0, 0, 1)):
            dQ = (N * dN - m * dm * (1 - c * c) + m * m * c * dc) / Q
            u, du = m * c, dm * c + m * dc
            v, dv = N * N * c, 2 * N * dN * c + N * N * dc
            w, dw = m * Q, dm * Q + m * dQ
            x, dx = u * N, du * N + u * dN
            quotients = (
                (u - Q, du - dQ, u + Q, du + dQ),
                (v - w, dv - dw, v + w, dv + dw),
                (2 * u, 2 * du, u + Q, du + dQ),
                (2 * x, 2 * dx, v + w, dv + dw),
            )
            for gradient, (top, d_top, bottom, d_bottom) in zip(gradients, quotients, strict=True):
                gradient.append((d_top * bottom - top * d_bottom) / bottom**2)
        return gradients


@functools.lru_cache(100_000)
def reflectance_gradients(c, n, k, m):
    """The gradients of R_s and of R_p with respect to (c, n, k, m); None where Q = 0."""
    with mp.workdps(DIGITS):
        gradients = amplitude_gradients(c, n, k, m)
        if gradients is None:
            return None
        values = amplitudes(c, n, k, m)
        return [
            [2 * mp.re(mp.conj(r) * dr) for dr in gradient]
            for r, gradient in zip(values[:2], gradients[:2], strict=True)
        ]
