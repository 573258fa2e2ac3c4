"""A wheel that measures the normal stress on its rim, and what follows from that."""
