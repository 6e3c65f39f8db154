"""The running process: compiled programs, interruption, progress, text for terminals."""
