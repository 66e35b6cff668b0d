"""The same course over tables N(A, omega)."""
