"""``jaka_bag replay-wire``: the command line that plays a recorded controller to the driver."""
import argparse
import contextlib
import tempfile
from pathlib import Path

from jaka_bag.cli.quantities import positive_number
from jaka_bag.compare.runs.loading import load_run
from jaka_bag.compare.tolerances import Tolerances, load_tolerances
from jaka_bag.errors import BagError
from jaka_bag.output_file import check_output

from .host_watch import HostWatch
from .replay import CANDIDATE, judge, record_wire, reports_of_this_run
from .scenario import ArmSetup, Scenario, scenario_of
from .stage import Script, script_of

_TOPICS = ("tool_position", "joint_position", "robot_states", "service_calls")

EPILOG = """\
WIRE is a log of a controller's bytes: of the simulated controller (jaka_sim --log) or of a real one (jaka_sim proxy).
A ROS master and the driver are started; the driver gets the same bytes at the same times, and to each request the
recorded reply to it. What the driver publishes is recorded as candidate.mcap in the folder of --output.

With --golden, the state log that was recorded at the same time, the service calls in it are made again at their
places among the bytes, and what is published is compared with it: exit code 0 same, 1 different.

examples:
  jaka_bag replay-wire wire.mcap
  jaka_bag replay-wire wire.mcap --golden golden.mcap -o report

Exit code: 0 done, 1 different or failed, 2 usage.
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of ``jaka_bag replay-wire``."""
    add = parser.add_argument
    add("wire", metavar="WIRE", help="log of a controller's bytes, .mcap")
    add("--golden", metavar="LOG", help="state log to compare with, .bag or .mcap")
    add("--tolerances", metavar="FILE", help="YAML file with what differs from the default tolerances")
    add("--speed", type=positive_number, default=1.0, metavar="N", help="the bytes come N times faster, at most 10")
    add("--model", metavar="NAME", help="the arm; default: of the golden log's recording, else zu7")
    add("-o", "--output", metavar="FOLDER", help="for the log, the reports and what the processes print; "
                                                 "default: a new folder among the temporary files")
    add("-f", "--force", action="store_true", help="overwrite what is in the folder")


def run(args: argparse.Namespace) -> int:
    """Play, record, compare; 0 done or same, 1 different."""
    limits = load_tolerances(args.tolerances)
    folder = Path(args.output) if args.output else Path(tempfile.mkdtemp(prefix="jaka_replay_wire_"))
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise BagError("cannot make the folder %s: %s" % (folder, error.strerror)) from error
    check_output(folder / CANDIDATE, args.force)
    with reports_of_this_run(folder, args.golden) if args.golden else contextlib.nullcontext():
        return _play(args, folder, limits)


def _play(args: argparse.Namespace, folder: Path, limits: Tolerances) -> int:
    golden = load_run(args.golden, limits) if args.golden else None
    scenario = scenario_of(args.golden) if args.golden else Scenario()
    if args.golden and not args.tolerances:
        limits = scenario.tolerances
    first = scenario.arms[0]
    arm = ArmSetup(first.namespace, args.model or first.model, parameters=first.parameters)
    topics = tuple("%s/jaka_driver/%s" % (arm.namespace, topic) for topic in _TOPICS)
    script = script_of(golden) if golden is not None else Script(None, (), 0.0, topics)
    with HostWatch() as host:
        candidate, told = record_wire(args.wire, script, folder, Scenario(arms=(arm,)), args.speed)
    print("recorded %s: %d requests answered as recorded, %d more often than recorded%s"
          % (candidate, told["answered"], told["repeated"],
             "; without an answer: %s" % ", ".join(told["unanswered"]) if told["unanswered"] else ""))
    if golden is None:
        return 0
    result = judge(golden, candidate, folder, limits, args.speed, host)
    print(result.summary)
    return 0 if result.same else 1
