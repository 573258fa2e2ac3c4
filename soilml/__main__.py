"""`python -m soilml`: the command line where no script is on the path."""

import sys

from soilml.cli.main import main

if __name__ == "__main__":
    sys.exit(main())
