"""The report of a gap analysis: its result, its sentences and its page."""
