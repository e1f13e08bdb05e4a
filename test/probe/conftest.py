"""Fixtures of the tests of jaka_probe."""
import contextlib

import pytest
from probe_bench import Controller


@pytest.fixture
def controller(tmp_path):
    with contextlib.ExitStack() as stack:
        def start(*arguments):
            return stack.enter_context(contextlib.closing(Controller(tmp_path, *arguments)))
        yield start
