"""Rows to learn from, and what may be learned from them."""
