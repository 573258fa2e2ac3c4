"""What commands print and write of their results: text, tables, and the page of --report."""
