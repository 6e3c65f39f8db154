"""Refractive indices: formulas, tables, mixtures. No public module, though it has no underscore.

The public modules are `dispersion` and `effective_medium`, which export what users need; other
names and signatures here change without notice.
"""
