"""The report page of a gap analysis: formatting, plots and the page itself."""
