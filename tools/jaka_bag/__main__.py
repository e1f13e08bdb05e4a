"""The command ``jaka_bag`` as a module that Python can run."""
import sys

from .cli.main import main

if __name__ == "__main__":
    sys.exit(main())
