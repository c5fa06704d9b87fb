"""Models of the output of a vehicle under recorded commands."""
