"""Learning in many simulated arms at once."""
