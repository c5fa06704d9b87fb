"""What estimators read from a recording, and what they refuse."""
