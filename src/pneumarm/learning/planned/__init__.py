"""Agents that have learned nothing but the simulation, and plan in it every turn anew."""
