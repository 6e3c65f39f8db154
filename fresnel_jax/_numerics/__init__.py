"""Arithmetic and arguments: what every formula of the package is computed with. No public module.

Exact sums and products, complex numbers as pairs, double words, three-vectors, what keeps XLA from
undoing any of them, and the checks of what users pass. Nothing here knows of optics but `Index`,
which is an argument as arrays are.
"""
