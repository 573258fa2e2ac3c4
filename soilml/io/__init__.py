"""Tables and files in and out; knows no physics."""
