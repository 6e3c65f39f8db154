"""From where the starts of a fit ended to its result: quality, findings, warnings."""
