"""Describing functions measured: errors relative to N, their least squares, the search over the plane."""
