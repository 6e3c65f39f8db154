"""Dispersion models over whole curves: an interface or a slab, through an imperfect instrument."""
