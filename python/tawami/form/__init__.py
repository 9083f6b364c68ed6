"""A weak form: what it declares, what its residual may name, its derived tangent and its kernels."""
