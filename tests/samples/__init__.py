"""Samples, materials and instruments: what a model predicts."""
