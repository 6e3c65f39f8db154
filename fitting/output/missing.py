"""What is said where a package that only some outputs need is not installed."""

from __future__ import annotations


class MissingExtra(ValueError, ImportError):
    """A package is not installed; the text names what asked for it and how to install it."""

    def __init__(self, asked: str, package: str, extra: str) -> None:
        super().__init__(
            f"{asked} needs {package}, which is not installed: pip install {package} "
            f"(or install fresnel-jax with its extra {extra!r})."
        )
