"""Speed against accuracy: `make bench`, or `python -m benchmarks`."""
