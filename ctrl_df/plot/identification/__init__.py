"""Pictures of models beside records and tables."""
