"""Multiple shooting: a model over segments of records, the descent, where segments begin, the noise."""
