"""Bounded least-squares fits of cases to readings, many in step."""
