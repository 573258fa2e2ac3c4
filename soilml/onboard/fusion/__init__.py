"""Fusion of estimates whose errors are known from common held-out rows."""
