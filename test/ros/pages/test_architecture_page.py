"""The page docs/architecture.md: a real joint_move goes the way that it shows, and its table of own code is backed."""
import re
import sys
import threading
from pathlib import Path

import import_graph
import pytest
from arm_bench import Bench
from driver_bench import HOME
from waiting import eventually

from jaka_msgs.srv import MoveRequest
from jaka_ros_driver.client.arm_client import LoopTask
from jaka_ros_driver.commands import JointMove
from jaka_ros_driver.ros.audit.recorder import Recorder
from jaka_ros_driver.ros.convert import RequestDecoder
from jaka_ros_driver.ros.frame_table import FrameReader
from jaka_ros_driver.ros.params import config_from
from jaka_ros_driver.ros.services.handlers import ServiceHandlers
from jaka_ros_driver.ros.services.table import SERVICES, Services

PACKAGE = import_graph.ROOT / "jaka_ros_driver"
PAGE = (import_graph.ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")


def part(name):
    return re.search(r"<!-- %s -->\n(.*?)<!-- end -->" % name, PAGE, re.DOTALL).group(1)


def stations():
    """Return (file, names of functions to the wire, names of functions back) of each row."""
    rows = [[cell.strip() for cell in line.split("|")[1:-1]] for line in part("the way of a move").splitlines()[2:]]
    return [(row[1].strip("`"), re.findall(r"`(\w+)`:", row[2]), re.findall(r"`(\w+)`:", row[3])) for row in rows]


class Trace(LoopTask):
    """A record of the driver's functions in the order of their calls, here and in the client's thread, inside
    ``with``."""

    def __init__(self, arm):
        self._is_on = False
        self._caller = threading.get_ident()
        self._thread_is_traced = threading.Event()
        self.out, self.back = [], []
        arm.add_task(self)
        assert self._thread_is_traced.wait(20.0)

    def due(self):
        return None if self._thread_is_traced.is_set() else 0.0

    def run(self, now):
        sys.setprofile(self._note)
        self._thread_is_traced.set()

    def _note(self, frame, event, _argument):
        if not self._is_on or event != "call":
            return
        path = Path(frame.f_code.co_filename)
        if PACKAGE in path.parents and "simulation" not in path.parts:
            calls = self.out if threading.get_ident() == self._caller else self.back
            calls.append((path.relative_to(PACKAGE).as_posix(), frame.f_code.co_name))

    def __enter__(self):
        sys.setprofile(self._note)
        self._is_on = True
        return self

    def __exit__(self, *_):
        self._is_on = False
        sys.setprofile(None)


class NoCallPublisher:
    def answered(self, *_):
        pass

    failed = answered


@pytest.fixture(scope="module")
def trace(tmp_path_factory, ros_node):
    """Return the trace of one joint_move, from the service's handler on."""
    bench = Bench(tmp_path_factory.mktemp("bench"))
    try:
        arm = bench.connect()
        config = config_from({"ip": "127.0.0.1"})
        handlers = ServiceHandlers(arm, config, FrameReader(arm), None)
        services = Services(RequestDecoder(arm.model), handlers, NoCallPublisher(), Recorder(None))
        (spec,) = [row for row in SERVICES if row.name == "joint_move"]
        handle = services._handler(spec)
        recording = Trace(arm)
        assert eventually(lambda: arm.state is not None)
        arm.move(JointMove(HOME, 2.0, 10.0))  # of an arm that is known to rest: another one waits for that first
        with recording:
            answer = handle(MoveRequest(pose=[0.2] + HOME[1:], mvvelo=1.0, mvacc=5.0))
        assert answer.ret == 1, answer.message
        return recording
    finally:
        bench.close()


def test_the_way_has_at_most_twelve_files_and_each_once():
    files = [file for file, _, _ in stations()]
    assert len(files) == len(set(files)) <= 12 and all((PACKAGE / file).is_file() for file in files)


def test_to_the_wire_each_station_is_met_in_the_order_of_the_page(trace):
    position = 0
    for step in [(file, name) for file, names, _ in stations() for name in names]:
        assert step in trace.out[position:], "%s is not called, or before the station above it" % (step,)
        position = trace.out.index(step, position) + 1


def test_back_each_station_is_met(trace):
    seen = set(trace.back) | set(trace.out)
    assert not {(file, name) for file, _, names in stations() for name in names} - seen


def test_no_other_file_is_met_but_those_named_beside_the_way(trace):
    beside = set(re.findall(r"`([\w/]+\.py)`", part("beside the way")))
    assert {file for file, _ in trace.out + trace.back} == beside | {file for file, _, _ in stations()}


OWN_CODE = part("own code").splitlines()[2:]
DEFINED = {name for path in (import_graph.ROOT / "test").rglob("test_*.py")
           for name in re.findall(r"^def (test_\w+)", path.read_text(encoding="utf-8"), re.MULTILINE)}
BENCHMARKS = {path.stem for path in (import_graph.ROOT / "test" / "benchmark").glob("bench_*.py")}


@pytest.mark.parametrize("row", OWN_CODE, ids=lambda row: row.split("|")[1].strip())
def test_what_is_our_own_is_backed_by_tests_or_benchmarks_that_exist(row):
    shown = set(re.findall(r"`((?:test|bench)_\w+)`", row))
    assert (shown or "rest on it" in row) and not shown - DEFINED - BENCHMARKS
