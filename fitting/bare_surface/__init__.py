"""One index at a time: eta + i k of a bare interface, for one curve or for many at once."""
