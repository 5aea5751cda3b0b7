"""The thesis' nine networks a joint, learned in many simulated arms at once."""
