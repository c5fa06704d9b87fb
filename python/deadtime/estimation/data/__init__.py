"""What the methods read from a recording, and the checks that refuse unusable ones."""
