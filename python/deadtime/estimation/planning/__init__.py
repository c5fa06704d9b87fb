"""What an experiment will tell, before it is run."""
