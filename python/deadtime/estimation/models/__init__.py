"""Models that predict an output from recorded commands."""
