"""Limit cycles: predicted, graded, traced exactly and verified."""
