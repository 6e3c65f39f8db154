"""Stacks of layers between two half-spaces. No public module, though its name has no underscore.

The public module is `layers`; names and signatures here change without notice. There are two tiers,
which share nothing but the arguments: `fast` alone is the fast one, all else the exact one.
"""
