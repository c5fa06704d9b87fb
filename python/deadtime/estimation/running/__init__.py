"""Estimate the delay while a loop runs. Its names are in `deadtime.estimation`."""
