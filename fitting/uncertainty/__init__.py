"""Errors of the parameters: covariance, intervals, profile likelihood, stated errors."""
