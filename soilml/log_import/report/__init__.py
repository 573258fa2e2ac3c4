"""The report of an import as one self-contained HTML page."""
