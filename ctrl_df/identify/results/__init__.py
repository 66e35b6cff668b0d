"""What a diagnosis and a ladder return, and its explanation in words."""
