"""Control loops with a delay in them."""
