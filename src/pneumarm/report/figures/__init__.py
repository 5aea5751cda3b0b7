"""The figures of the report: pure functions from arrays to a figure that carries its text alternative."""
