"""`python -m stopgo`: the `stopgo` command."""

import sys

from stopgo import main

if __name__ == "__main__":
    sys.exit(main())
