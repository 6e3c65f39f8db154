"""The best minimum of a fit: where to start, what is tried beside the lowest ends, last steps."""
