"""What a fit leaves of the data, whether it is noise, and what it says of stated errors."""
