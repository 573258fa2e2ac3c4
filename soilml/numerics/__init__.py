"""Numerical methods without soil mechanics: roots, quadrature, sampling, fusion of estimates."""
