"""The commands that a replay starts, all of them, as arguments of this interpreter.

Commands that people start, too, are started by the function that their own files call, for a replay does not know where
those files are.
"""
from typing import Tuple


def _calling_main_of(module: str) -> Tuple[str, str]:
    return "-c", "import sys; from %s import main; sys.exit(main())" % module


JAKA_BAG = _calling_main_of("jaka_bag.cli.main")
SIMULATION = _calling_main_of("jaka_ros_driver.simulation.__main__")
DRIVER = _calling_main_of("jaka_ros_driver.ros.node")
REPLAYER = ("-m", "jaka_ros_driver.wire.replayer")
OPERATOR_SESSION = ("-m", "jaka_ros_driver.simulation.server.operator_session")
LIVE_WATCH = ("-m", "jaka_regression.cell.live_watch")
CALLERS_PATH = "JAKA_CELL_PYTHONPATH"
LAUNCH = ("-c", "import os, sys, roslaunch; os.environ['PYTHONPATH'] = os.environ.pop(%r); "
                "roslaunch.main(['roslaunch', *sys.argv[1:]])" % CALLERS_PATH)
"""The command roslaunch, of the interpreter that runs this. The nodes that it starts may have another interpreter: they
get the PYTHONPATH in the variable ``CALLERS_PATH``, which is the caller's own."""

MASTER = ("-c", "from rosmaster.master import Master\nimport signal\nimport time\n"
                "signal.signal(signal.SIGINT, signal.SIG_DFL)\nmaster = Master(0)\nmaster.start()\n"
                "print(master.uri, flush=True)\nwhile master.ok():\n    time.sleep(0.1)\n")
"""A ROS master on a free port; prints its URI. What a shell starts in the background inherits a SIGINT that is ignored:
each process here that is ended by SIGINT sets what it does then."""


def driver_in(folder: str) -> Tuple[str, str]:
    """Return ``DRIVER`` for the packages in a folder, which come before this interpreter's own."""
    return "-c", "import sys; sys.path.insert(0, %r); %s" % (folder, DRIVER[1])
