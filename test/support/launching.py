"""roslaunch and masters inside the test process, ended so that nothing of them runs on."""
import contextlib

import roslaunch

RUN_ID = "jaka-tests"


def end_server(node):
    """End the thread that serves a rosgraph XmlRpcNode.

    The node's own shutdown only closes the socket, and the thread polls the closed descriptor for ever.
    """
    if node is not None and node.server is not None:
        node.is_shutdown = True
        node.server.shutdown()


@contextlib.contextmanager
def launched_parent(files=(), **options):
    """A ROSLaunchParent that runs these (path, arguments) of launch files."""
    parent = roslaunch.parent.ROSLaunchParent(RUN_ID, list(files), **options)
    parent.start()
    try:
        yield parent
    finally:
        end_server(parent.server)
        parent.shutdown()
