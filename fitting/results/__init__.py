"""`Fit`, the result of every fit, and its warnings as data and sentences."""
