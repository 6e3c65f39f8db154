"""Fits of films: thicknesses, fringes, and an index that is free."""
