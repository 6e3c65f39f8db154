"""The least-squares problem of many lanes: rows, unknowns, programs, solver, evaluation."""
