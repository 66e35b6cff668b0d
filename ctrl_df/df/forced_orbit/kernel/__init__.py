"""Compiled: the period map, Newton steps on it, secant steps to an orbit, orbits along a line."""
