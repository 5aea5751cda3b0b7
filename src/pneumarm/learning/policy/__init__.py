"""A policy over valves, learned in many simulated arms at once."""
