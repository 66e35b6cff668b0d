"""Numbers and names in the place of one: a column for many runs, a value of each record."""
