"""`python -m stixel_cli`: the command `stixel`, of the interpreter that runs."""

import sys

from stixel_cli.cli.app import main

if __name__ == "__main__":
    sys.exit(main())
