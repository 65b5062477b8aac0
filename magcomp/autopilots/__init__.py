"""What each autopilot does to a compass reading, and the names of the parameters that say so."""
