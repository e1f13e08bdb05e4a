"""Fixtures of the tests of jaka_probe."""
import contextlib
import signal

import pytest
from probe_bench import Controller


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
