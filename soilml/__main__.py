"""`python -m soilml`: the command line, where the script `soilml` is not on the path."""

import sys

from soilml.cli.main import main

if __name__ == "__main__":
    sys.exit(main())
