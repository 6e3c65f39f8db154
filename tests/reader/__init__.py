"""From the bytes of a measured file, or from arrays, to a Measurement."""
