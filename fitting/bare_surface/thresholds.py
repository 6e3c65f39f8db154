"""The limits beyond which an index is called undetermined."""

CORRELATION_LIMIT = 0.995
VAGUE_LIMIT = 0.1
# Two standard errors reach 0: the value is known to an order of magnitude at best, and the
# quadratic approximation behind the standard error no longer holds.
UNDETERMINED_LIMIT = 0.5
# Change of x = log[(1 + |N|^2) / 2n] along the null direction of the Fisher matrix, over all k.
CIRCLE_LIMIT = 0.1
FLAT_BELOW_DEG = 30.0
# R(0) within 2 exp(-x) = 2.5e-4 of 1: no plain metal reflects so well, or shows it if it does.
MIRROR_LIMIT = 9.0
# exp(x) - 1 = |N - 1|^2 / 2n: R(0) below 5e-17, less than the rounding of any datum.
NOTHING_LIMIT = 1e-16
