"""The report as an HTML page: one template and, where needed, one builder for each section."""
