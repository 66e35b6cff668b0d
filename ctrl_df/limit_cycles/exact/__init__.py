"""Exact periodic orbits of a loop, and what its motions come to: by the engine alone."""
