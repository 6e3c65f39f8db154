"""The formulas of one smooth boundary. No public module, though its name has no underscore.

The public modules are `interface`, `polarization`, `directions`, `approximate` and `layers`, which
check the arguments and call what is here; names and signatures here change without notice.
"""
