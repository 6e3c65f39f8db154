"""Where each method fails."""
