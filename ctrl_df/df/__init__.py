"""Describing functions: N(a, omega) of the blocks, in closed form or by quadrature."""
