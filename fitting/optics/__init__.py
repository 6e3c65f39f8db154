"""Predicted values of a sample behind an instrument, for every row of the data."""
