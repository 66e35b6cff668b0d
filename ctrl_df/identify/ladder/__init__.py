"""Effects one after another: the way up, back, and to the neighbours of where it ends."""
