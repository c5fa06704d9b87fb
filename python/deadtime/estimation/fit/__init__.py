"""Least squares, profile likelihood, and tests of residuals."""
