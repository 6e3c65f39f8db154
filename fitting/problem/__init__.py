"""Residuals of many lanes and their least squares: rows, unknowns, programs, solver, evaluation."""
