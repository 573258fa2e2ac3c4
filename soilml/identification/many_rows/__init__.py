"""Tables of more rows than a fit holds: rows that were driven alike become one."""
