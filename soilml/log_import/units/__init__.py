"""Units of logs, and values with a unit and a standard deviation."""
