"""The plant and its delay from a recording alone: the kinds of plant that explain it compete."""
