"""The one result of every fit, and its warnings: data, and one table of their sentences."""
