"""The command ``fresnel-fit``."""
