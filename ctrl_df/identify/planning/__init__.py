"""Inputs that would separate what a diagnosis leaves open."""
