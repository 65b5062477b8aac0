"""An analysis for people and for programs."""
