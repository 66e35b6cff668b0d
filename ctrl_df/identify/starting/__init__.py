"""Where fits of an effect begin: guesses from the record, a linear screen, searches over a parameter."""
