"""From a sample and an instrument to what is measured, row by row."""
