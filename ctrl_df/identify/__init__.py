"""Identification: compare, refit and diagnose a model against measurements."""
