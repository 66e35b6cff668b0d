"""Fits of one model, from short segments to the full rate: starts, segmentations, uncertainty."""
