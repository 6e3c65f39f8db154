"""eta and k of one bare surface from R_s, R_p and R over the angle, of one curve or of many."""
