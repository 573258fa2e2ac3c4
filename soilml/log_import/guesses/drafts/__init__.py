"""Drafts of the tables of channels: unit, sign, tare, and what stands between."""
