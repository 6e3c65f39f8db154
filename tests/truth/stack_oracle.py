"""Stacks by characteristic matrices, as textbooks print them, with digits to spare in mpmath.

Nothing is rearranged or scaled: the matrices' entries grow as they will, and the working precision
is raised by twice as many digits. Only where that would need more than 3,000 digits (a metre of
metal), Parratt's recursion for a decaying wave takes their place.
"""

import mpmath as mp


def exact(value):
    """The value of a float or complex float (or an mpmath number) in mpmath."""
    if isinstance(value, (mp.mpf, mp.mpc)):
        return value
    value = complex(value)
    return mp.mpf(value.real) if value.imag == 0.0 else mp.mpc(value.real, value.imag)


def _normal(N, K2, E=None):
    """Q of s; with the extraordinary index E that of p, N_o^2 (1 - K^2 / N_e^2)."""
    if E is None or E == N:
        q = mp.sqrt(N * N - K2)
        return q if mp.re(q) + mp.im(q) >= 0 else -q
    q = mp.sqrt(N * N * (1 - K2 / E**2))
    return q if mp.re(q / N**2) >= 0 else -q  # power goes away from the boundary


def _by_matrices(Y, Q, d, k0):
    U, V = mp.mpc(1), Y[-1]
    for y, q, t in reversed(list(zip(Y[1:-1], Q[1:-1], d, strict=True))):
        delta = k0 * t * q
        sine_over_y = mp.sin(delta) / y if q != 0 else k0 * t * (q / y if y != 0 else 1)
        U, V = (
            mp.cos(delta) * U - 1j * sine_over_y * V,
            mp.cos(delta) * V - 1j * y * mp.sin(delta) * U,
        )
    return (Y[0] * U - V) / (Y[0] * U + V), 2 * Y[0] / (Y[0] * U + V)


def _by_recursion(Y, Q, d, k0):
    def boundary(i):
        return (Y[i] - Y[i + 1]) / (Y[i] + Y[i + 1]), 2 * Y[i] / (Y[i] + Y[i + 1])

    r, t = boundary(len(d))
    for i in reversed(range(len(d))):
        e = mp.exp(1j * k0 * d[i] * Q[i + 1])
        r_here, t_here = boundary(i)
        bottom = 1 + r_here * r * e * e
        r, t = (r_here + r * e * e) / bottom, t_here * t * e / bottom
    return r, t


def stack(c, N, d, wavelength, digits=50):
    """R_s, R_p, T_s, T_p, r_s, r_p, t_s, t_p; N_o and N_e as a tuple are a uniaxial medium."""
    E = [z[1] if isinstance(z, tuple) else None for z in N]
    N = [z[0] if isinstance(z, tuple) else z for z in N]
    with mp.workdps(digits):
        c, wavelength = exact(c), exact(wavelength)
        N, d = [exact(z) for z in N], [exact(z) for z in d]
        E = [z if e is None else exact(e) for z, e in zip(N, E, strict=True)]
        K2 = N[0] ** 2 * (1 - c * c)
        Q = [_normal(z, K2) for z in N[1:-1]]
        growth = sum((abs(mp.im(q)) * t for q, t in zip(Q, d, strict=True)), mp.mpf(0))
        turns = sum((abs(q) * t for q, t in zip(Q, d, strict=True)), mp.mpf(0)) / wavelength
        enough = digits + 20 + int(mp.log10(1 + turns))
        matrices = enough + int(4 * mp.pi * growth / wavelength / mp.log(10)) < 3000
        if matrices:
            enough += int(4 * mp.pi * growth / wavelength / mp.log(10))
    with mp.workdps(enough):
        K2 = N[0] ** 2 * (1 - c * c)
        every = {
            "s": [N[0] * c, *(_normal(z, K2) for z in N[1:])],
            "p": [
                N[0] * c,
                *(_normal(*z) for z in zip(N[1:], [K2] * (len(N) - 1), E[1:], strict=True)),
            ],
        }
        k0 = 2 * mp.pi / wavelength
        out = []
        for polarization in "sp":
            Q = every[polarization]
            Y = Q if polarization == "s" else [q / (z * z) for q, z in zip(Q, N, strict=True)]
            r, t = (_by_matrices if matrices else _by_recursion)(Y, Q, d, k0)
            T = abs(t) ** 2 * mp.re(Y[-1]) / mp.re(Y[0])
            out.append((abs(r) ** 2, T, r, t if polarization == "s" else t * N[0] / N[-1]))
        return tuple(z for pair in zip(*out, strict=True) for z in pair)
