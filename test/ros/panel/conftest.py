"""The pages that the tests of the panel share; they live in one loop."""
import contextlib

import pytest
from panel_page import Loop
from tls_proxy import certificate_in


@pytest.fixture(scope="module")
def loop():
    with contextlib.closing(Loop()) as loop:
        yield loop


@pytest.fixture(scope="session")
def certificate(tmp_path_factory):
    """Return the files of a certificate for localhost and its key."""
    return certificate_in(tmp_path_factory.mktemp("tls"))
