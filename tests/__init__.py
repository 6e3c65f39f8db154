"""Tests, in a room for each subject: see CONTRIBUTING.md."""
