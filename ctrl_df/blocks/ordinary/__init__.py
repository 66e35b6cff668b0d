"""Blocks as ordinary solvers take them: the compliant form, and where it has no derivative."""
