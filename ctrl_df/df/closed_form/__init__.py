"""N(a, omega) in closed form, by quadrature, or by maps from impact to impact."""
