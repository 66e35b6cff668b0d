"""N(a, omega) of anything else: its forced periodic orbit on the engine."""
