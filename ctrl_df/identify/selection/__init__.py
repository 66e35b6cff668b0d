"""Which effect is missing: attempts compared by their evidence."""
