"""The compiled engine: flow of a mode, steps, events, outputs."""
