"""The command line: parser, signals, shared options and output."""

from soilml.cli.main import main

__all__ = ["main"]
