"""The force that is missing, as a signal: fixed-interval smoothing over the event-located model."""
