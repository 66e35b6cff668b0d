"""Records as they come: measurements, their files, checks and signals."""
