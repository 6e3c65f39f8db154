"""Documentation, examples and benchmarks."""
