"""``python -m jaka_bag``: the program ``jaka_bag``."""
import sys

from .cli.main import main

if __name__ == "__main__":
    sys.exit(main())
