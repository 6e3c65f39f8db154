"""`choose`: which model or sample the data ask for."""
