"""The largest errors of the library, found by search."""
