"""Residuals of a fit, whether they are noise, and what they show of stated errors."""
