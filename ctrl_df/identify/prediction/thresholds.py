"""What a model makes of a record: tuned numbers, each with what it follows from."""

from __future__ import annotations

HIDDEN_RTOL = 1e-4
"""Tolerance of hidden states under an imposed motion: of steps no longer than a sample it leaves errors of
some 1e-6 of the force, and is twice as fast as 1e-6 (records)."""
