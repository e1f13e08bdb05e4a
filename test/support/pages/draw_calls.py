"""A command that draws the calls of a joint_move into docs/architecture.md, as its test sees them:

    . build/devel/setup.bash && build/venv/bin/python3 test/support/pages/draw_calls.py
"""
import os
import sys
from pathlib import Path

import pytest

TEST = Path(__file__).resolve().parents[2] / "ros" / "pages" / "test_architecture_page.py"


def main():
    """Run the test of the page so that it writes what it sees."""
    os.environ["JAKA_DRAW_THE_CALLS_ANEW"] = "1"
    sys.exit(pytest.main(["-q", str(TEST), "-k", "picture_shows"]))


if __name__ == "__main__":
    main()
