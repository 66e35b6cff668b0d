"""Save files: a journal while a family is computed, then the family, bound to its computation."""
