"""What concerns the running process: compiled programs, interruption, progress, terminals."""
