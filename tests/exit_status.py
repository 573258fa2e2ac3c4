"""The exit status of a command, whether its work or its parser refuses."""

from soilml.cli import main


def exit_status(words):
    """The status with which `soilml WORDS` ends."""
    try:
        return main(words)
    except SystemExit as done:  # an argument that the parser refuses
        return done.code
