"""The pages that the tests of the panel share; they live in one loop."""
import contextlib

import pytest
from panel_page import Loop


@pytest.fixture(scope="module")
def loop():
    with contextlib.closing(Loop()) as loop:
        yield loop
