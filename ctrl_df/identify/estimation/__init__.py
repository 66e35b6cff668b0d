"""Fits of one model: segments, multiple shooting, initial states, noise, uncertainty."""
