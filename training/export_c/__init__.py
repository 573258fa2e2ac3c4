"""A model file as C99 code for a board without Python: `soilml export c`."""
