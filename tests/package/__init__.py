"""What the packages offer, how they are built, and the process that they run in."""
