"""Values that look odd, with the likely cause: of tables of runs, of maps, and of sensors."""
