"""Points, fits and compile times, beside other programs."""
