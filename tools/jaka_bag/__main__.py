"""``python -m jaka_bag``: the program ``jaka_bag``."""
import sys

from .cli.main import main

sys.exit(main())
