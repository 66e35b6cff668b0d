"""The event-driven engine and the loops it runs."""
