"""Least squares, profiles of a parameter, and residuals."""
