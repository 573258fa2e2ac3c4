"""The verdict of a gap analysis: status, claimed effects, figures, and what is left."""
