"""Parameter files, and the safe way from a parameter set to a vehicle and back."""
