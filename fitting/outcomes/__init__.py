"""The result of a fit from the ends of its starts: quality, findings, warnings."""
