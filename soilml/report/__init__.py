"""What reports and tables share: rounded numbers in usual units, style of figures, the page."""
