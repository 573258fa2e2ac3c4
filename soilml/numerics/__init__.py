"""Numerical methods without soil mechanics: roots, quadrature, sampling, distributions."""
