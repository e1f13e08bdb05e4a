"""A server in a thread of this process, for sources of the tests' making; no test leaves a thread behind."""
import asyncio
import contextlib
import threading

import live_samples
import pytest
import waiting


@pytest.fixture
def running():
    """Return a function that runs a source's server until the end of the test: ``running(source, rules, limits)``.

    The server's notices are kept.
    """
    from jaka_foxglove.access import AccessRules
    from jaka_foxglove.server import FoxgloveServer, ViewerLimits

    with contextlib.ExitStack() as stack:
        def run(source, rules=None, limits=None):
            notices = []
            server = FoxgloveServer(source, rules or AccessRules(), limits or ViewerLimits(), notices.append)
            ready = threading.Event()
            thread = threading.Thread(target=lambda: asyncio.run(server.run("127.0.0.1", 0, ready.set)))
            thread.start()
            stack.callback(thread.join)
            stack.callback(server.stop)
            assert ready.wait(waiting.WAIT)
            server.notices = notices
            return server
        yield run


@pytest.fixture(autouse=True)
def no_thread_stays():
    """Fail a test that leaves a thread behind."""
    with live_samples.no_thread_stays():
        yield
