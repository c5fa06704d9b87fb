"""Bounds and Monte Carlo simulations of planned experiments."""
