"""Tables, settings and results of a climb, in and out."""
