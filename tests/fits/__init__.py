"""Fits: starts, minima, values and findings of surfaces, plates and many curves."""
