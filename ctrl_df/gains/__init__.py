"""Choosing gains: what a loop does over the plane of two gains, and a PID without a limit cycle."""
