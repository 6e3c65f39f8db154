"""Samples, their text form, the models and materials of their media, and their parameters."""
