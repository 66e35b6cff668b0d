"""Limit cycles predicted with the describing function, and how far a prediction can be trusted."""
