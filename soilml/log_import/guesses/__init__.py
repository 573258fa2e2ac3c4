"""What the columns of a log probably are: by name, by unit, and by how their values behave."""
