"""The live page: a server on the loopback interface, and what the page asks it."""
