"""The robot controller: communication (newest reference in, state out) composed with 30 ms interpolation."""
