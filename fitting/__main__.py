"""``python -m fitting FILE``, the same as ``fresnel-fit FILE``."""

from fitting.cli import main

if __name__ == "__main__":
    raise SystemExit(main())
