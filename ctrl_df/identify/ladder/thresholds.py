"""Numbers of the ladder that were chosen, each with its reason."""

RIVALS = 2
"""Candidates that are fitted in the place of an effect of a ladder: beside a later one, and at its end."""

BRANCHES = 3
"""Rivals of steps from which a ladder begins again where it ended with something unexplained: of two effects
hidden one that stands in for both ranks first, and the right ones follow (rigs)."""
