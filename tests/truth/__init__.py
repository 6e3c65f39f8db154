"""What is true by other means than the library: textbook formulas, tables, known files."""
