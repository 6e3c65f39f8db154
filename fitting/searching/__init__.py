"""The search for the best minimum: starts, further starts near the lowest minima, last steps."""
