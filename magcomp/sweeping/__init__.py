"""A guided sweep on the ground: which motors spin, how long, and what stops them at once."""
