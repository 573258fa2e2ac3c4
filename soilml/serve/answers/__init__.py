"""What the page shows, as JSON: the forward model, tables, logs, estimates and gaps."""
