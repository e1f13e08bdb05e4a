"""Fixtures of the tests of jaka_probe."""
import contextlib
import signal
import sys
from pathlib import Path

import pytest
from probe_bench import Controller

HERE = str(Path(__file__).resolve().parent)
if HERE not in sys.path:  # virtual_probe lies beside the tests of this folder
    sys.path.insert(0, HERE)


@pytest.fixture
def controller(tmp_path):
    with contextlib.ExitStack() as stack:
        def start(*arguments):
            return stack.enter_context(contextlib.closing(Controller(tmp_path, *arguments)))
        yield start


@pytest.fixture
def ctrl_c():
    """Take Ctrl-C as a new Python does: rospy's handler stays in a process that has been a node."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)
