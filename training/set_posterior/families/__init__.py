"""Families of wheels on soils: how they are driven, how they respond, and simulated sets."""
