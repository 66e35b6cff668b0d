"""The rigorous error bound of Mees & Bergen for a predicted cycle, where its theorem applies."""

from __future__ import annotations


def mees_bergen(F, method, linear, amplitude, omega):
    """Placeholder until the bound is written."""
    return None, ""
