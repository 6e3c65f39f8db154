"""The command fresnel-fit."""
