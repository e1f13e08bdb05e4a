"""The modules that a replay starts as programs, as arguments of the interpreter: all of them stand here."""
from typing import Tuple

JAKA_BAG = ("-m", "jaka_bag.__main__")
SIMULATION = ("-m", "jaka_ros_driver.simulation")
WIRE_PLAYER = ("-m", "jaka_ros_driver.wire.player")
PANEL_SESSION = ("-m", "jaka_ros_driver.simulation.server.panel_session")

_DRIVER_MODULE = "jaka_ros_driver.ros.node"
DRIVER = ("-c", "import sys; from %s import main; sys.exit(main())" % _DRIVER_MODULE)
STAGE = ("-m", "jaka_regression.many.stage_program")

MASTER = ("-c", "from rosmaster.master import Master\nimport signal\nimport time\n"
                "signal.signal(signal.SIGINT, signal.SIG_DFL)\nmaster = Master(0)\nmaster.start()\n"
                "print(master.uri, flush=True)\nwhile master.ok():\n    time.sleep(0.1)\n")
"""A ROS master on a free port; prints its URI. What a shell starts in the background inherits a SIGINT that is ignored:
each program here that is ended by SIGINT sets what it does then."""


def driver_in(folder: str) -> Tuple[str, str]:
    """As ``DRIVER``, of the packages in a folder, which come before this interpreter's own."""
    return "-c", "import sys; sys.path.insert(0, %r); %s" % (folder, DRIVER[1])
