"""Files and arrays to measurements: rows of quantity, angle, wavelength, value and error."""
