"""What a model can be fitted to: records over time, tables N(A, omega); one interface."""
