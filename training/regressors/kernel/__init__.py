"""Numerics of the kernel regressors: kernels, prototypes, solutions in bounded memory."""
