"""Logs of autopilots: what they hold, and the recordings of their loops."""
