"""The command line: parser, signals, shared options and output."""

from soilml.cli.process import StopSignals

with StopSignals():  # a signal during the imports is answered in one line, too
    from soilml.cli.main import main

__all__ = ["main"]
