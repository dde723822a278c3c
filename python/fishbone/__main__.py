"""`python -m fishbone`: the command line."""

import sys

from fishbone.cli import main

if __name__ == "__main__":
    sys.exit(main())
