"""Standard errors, intervals, and what residuals say of stated errors."""
