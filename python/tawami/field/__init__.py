"""Assembly and constraints: (form, particle densities, P) -> reduced residual and tangent."""
