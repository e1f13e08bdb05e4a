"""The page docs/architecture.md: its calls of a move are those of a real joint_move, own code is backed by tests."""
import functools
import os
import re
import threading
from contextlib import closing

import import_graph
import pytest
import rospy
from arm_bench import Bench
from call_tracer import CallTracer, faults_of, tree
from code_lines import code_lines, lines_of_names
from driver_bench import HOME
from rospy.impl import tcpros_base
from waiting import eventually

from jaka_msgs.srv import Move
from jaka_ros_driver.audit.log import AuditLog
from jaka_ros_driver.client.loop_task import LoopTask
from jaka_ros_driver.commands import JointMove
from jaka_ros_driver.ros.audit.recorder import Recorder
from jaka_ros_driver.ros.convert import RequestDecoder
from jaka_ros_driver.ros.frame_table import FrameReader
from jaka_ros_driver.ros.params import config_from
from jaka_ros_driver.ros.services import server as server_module
from jaka_ros_driver.ros.services.call_publisher import CallPublisher
from jaka_ros_driver.ros.services.connection import ServiceConnection
from jaka_ros_driver.ros.services.handlers import ServiceHandlers
from jaka_ros_driver.ros.services.server import CallCount, ServiceServer, take_connection
from jaka_ros_driver.ros.services.table import SERVICES, Services

PACKAGE = import_graph.ROOT / "jaka_ros_driver"
PATH = import_graph.ROOT / "docs" / "architecture.md"
PAGE = PATH.read_text(encoding="utf-8")
WRITE = "JAKA_DRAW_THE_CALLS_ANEW"
"""Set in the environment, the page is written: test/support/pages/draw_calls.py does it."""
NUMBERS = re.compile(r"(One `joint_move` passes \*\*)(\d+)( files\*\*[^:]*: )(\d+)( in the thread of\nthe caller, )"
                     r"(\d+)")
"""The sentence in which the page says how many files a move passes: in all, in the caller's thread, in the client's."""
MOVES = 3
THREADS = ("of the caller", "of the client")


def part(name):
    return re.search(r"<!-- %s -->\n(.*?)<!-- end -->" % name, PAGE, re.DOTALL).group(1)


def stations():
    """Return (file, names of functions to the wire, names of functions back) of each row."""
    rows = [[cell.strip() for cell in line.split("|")[1:-1]] for line in part("the way of a move").splitlines()[2:]]
    return [(row[1].strip("`"), *(re.findall(r"`(\w+)`[:,]", cell) for cell in row[2:4])) for row in rows]


class FollowedThread(LoopTask):
    """The task that has the client's one thread followed by a tracer."""

    def __init__(self, arm, tracer):
        self._tracer = tracer
        self._is_followed = threading.Event()
        arm.add_task(self)
        assert self._is_followed.wait(20.0)

    def due(self):
        return None if self._is_followed.is_set() else 0.0

    def run(self, now):
        self.ident = threading.get_ident()
        self._tracer.follow()
        self._is_followed.set()


class FollowedConnection(ServiceConnection):
    """The connection of a client; the thread that serves it is followed by a tracer.

    Attributes:
        newest: The connection that was accepted last.
        idents: The threads that have served it; the first one has carried out its only request.
        has_ended: Set when it is closed.
    """

    def __init__(self, tracer, *arguments):
        self._tracer = tracer
        self.idents = []
        self.has_ended = threading.Event()
        FollowedConnection.newest = self
        super().__init__(*arguments)

    def serve(self):
        self.idents.append(threading.get_ident())
        self._tracer.follow()
        try:
            return super().serve()
        finally:
            self._tracer.follow_no_more()

    def close(self):
        super().close()
        self.has_ended.set()


class Traced:
    """The calls of some moves, in the caller's thread and in the client's: of any move, and of every one."""

    def __init__(self):
        self.any = {thread: {} for thread in THREADS}
        self.every = {}
        self.to_the_wire = []
        self.back = []

    def add(self, tracer, threads):
        for name, ident in zip(THREADS, threads):
            calls = tracer.calls[ident]
            for edge, functions in calls.items():
                self.any[name].setdefault(edge, {}).update(functions)
            kept = self.every.setdefault(name, calls)
            self.every[name] = {edge: {function: line for function, line in kept[edge].items() if function in now}
                                for edge, now in calls.items() if edge in kept}
        self.to_the_wire.append(tracer.sequence[threads[0]])
        self.back.append(tracer.sequence[threads[1]])

    @property
    def numbers(self):
        """The numbers of files: in all, in the caller's thread, in the client's."""
        both = [{file for edge in self.any[thread] for file in edge if file} for thread in THREADS]
        return (len(both[0] | both[1]), *map(len, both))


@pytest.fixture(scope="module")
def traced(tmp_path_factory, ros_node):
    """Trace calls of joint_move over TCP, from the connection on to its end, with audit log and record of calls."""
    folder = tmp_path_factory.mktemp("bench")
    bench, log = Bench(folder), AuditLog(str(folder / "audit"), 0)
    log.start()
    tracer, monkeypatch = CallTracer(PACKAGE), pytest.MonkeyPatch()
    server = None
    try:
        arm = bench.connect(silence_timeout=10.0, reply_timeout=10.0, stale_after=8.0)  # on a busy host, too
        handlers = ServiceHandlers(arm, config_from({"ip": "127.0.0.1"}), FrameReader(arm), None, None)
        services = Services(RequestDecoder(arm.model), handlers, CallPublisher(), Recorder(log))
        (spec,) = [row for row in SERVICES if row.name == "joint_move"]
        monkeypatch.setattr(server_module, "ServiceConnection", functools.partial(FollowedConnection, tracer))
        monkeypatch.setattr(tcpros_base.init_tcpros_server(), "service_connection_handler", take_connection)
        server = ServiceServer("~joint_move", Move, services._handler(spec), CallCount())
        thread = FollowedThread(arm, tracer)
        assert eventually(lambda: arm.state is not None)
        arm.move(JointMove(HOME, 2.0, 10.0))  # of an arm that is known to rest: another one waits for that first
        found = Traced()
        for number in range(MOVES):
            tracer.calls, tracer.sequence = {}, {}
            with tracer, closing(rospy.ServiceProxy("~joint_move", Move, persistent=True)) as call:
                answer = call(pose=[0.2 * (number % 2 + 1)] + HOME[1:], mvvelo=1.0, mvacc=5.0)
                call.close()
                assert FollowedConnection.newest.has_ended.wait(20.0)
            assert answer.ret == 1, answer.message
            found.add(tracer, (FollowedConnection.newest.idents[0], thread.ident))
        return found
    finally:
        if server is not None:
            server.shutdown()
        monkeypatch.undo()
        bench.close()
        log.close(20.0)


def test_to_the_wire_each_station_is_met_in_the_order_of_the_page(traced):
    for calls in traced.to_the_wire:
        position = 0
        for step in [(file, name) for file, names, _ in stations() for name in names]:
            assert step in calls[position:], "%s is not called, or before the station above it" % (step,)
            position = calls.index(step, position) + 1


def test_back_each_station_is_met(traced):
    for to_the_wire, back in zip(traced.to_the_wire, traced.back):
        assert not {(file, name) for file, _, names in stations() for name in names} - set(back) - set(to_the_wire)


def picture(thread):
    return part("calls in the thread " + thread).strip().strip("`").strip("\n").splitlines()


@pytest.mark.parametrize("thread", THREADS)
def test_the_picture_shows_the_calls_as_they_are_and_leaves_no_file_out(traced, thread):
    if WRITE in os.environ:
        text = PATH.read_text(encoding="utf-8")
        begin = "<!-- calls in the thread %s -->\n" % thread
        before, _, rest = text.partition(begin)
        lines = "\n".join(tree(traced.every[thread]))
        text = before + begin + "```\n" + lines + "\n```\n" + rest[rest.index("<!-- end -->"):]
        text = NUMBERS.sub(lambda match: match.expand(r"\g<1>%d\g<3>%d\g<5>%d" % traced.numbers), text)
        PATH.write_text(text, encoding="utf-8")
    else:
        assert not faults_of(picture(thread), traced.any[thread])


def test_the_page_says_how_many_files_a_move_passes(traced):
    told = NUMBERS.search(PAGE)
    assert tuple(int(told.group(group)) for group in (2, 4, 6)) == traced.numbers


@pytest.mark.parametrize("change, fault", [
    (lambda lines: lines[:-1], "is not shown"),
    (lambda lines: [*lines, "client/core/jog.py: begin"], "nobody does not call client/core/jog.py"),
    (lambda lines: [lines[0] + ", no_such_function", *lines[1:]], "does not call no_such_function of"),
])
def test_a_picture_that_shows_what_is_not_or_hides_what_is_is_noticed(change, fault):
    calls = {("", "a.py"): {"enter": 7}, ("a.py", "b.py"): {"step": 3}, ("b.py", "c.py"): {"act": 9}}
    right = tree(calls)
    assert right == ["a.py: enter", "  b.py: step", "    c.py: act"] and not faults_of(right, calls)
    assert any(fault in one for one in faults_of(change(right), calls))


OWN_CODE = re.findall(r"^- \*\*.*(?:\n  .*)*", part("own code"), re.MULTILINE)
DEFINED = {name for path in (import_graph.ROOT / "test").rglob("test_*.py")
           for name in re.findall(r"^def (test_\w+)", path.read_text(encoding="utf-8"), re.MULTILINE)}
BENCHMARKS = {path.stem for path in (import_graph.ROOT / "test" / "benchmark").glob("bench_*.py")}


def test_every_piece_of_own_code_is_found():
    assert len(OWN_CODE) >= 38


@pytest.mark.parametrize("piece", OWN_CODE, ids=lambda piece: piece[4:44])
def test_what_is_our_own_is_backed_by_tests_or_benchmarks_that_exist(piece):
    shown = set(re.findall(r"`((?:test|bench)_\w+)`", piece))
    assert (shown or "rest on it" in " ".join(piece.split())) and not shown - DEFINED - BENCHMARKS


@pytest.mark.parametrize("piece", [piece for piece in OWN_CODE if " lines." in piece], ids=lambda piece: piece[4:44])
def test_a_piece_of_own_code_is_as_long_as_the_page_says(piece):
    where, told = re.match(r"- \*\*.*?\*\*: (.*?), (\d+) lines\.", " ".join(piece.split())).groups()
    lines = lines_of_names(where, [import_graph.ROOT, PACKAGE])
    assert abs(lines - int(told)) <= max(10, 0.1 * lines), "%d lines" % lines


def test_lines_of_code_are_counted_without_comments_and_docstrings():
    source = '"""A module."""\n\n# why\nx = 1  # one\n\n\ndef f():\n    """Do."""\n    return (x,\n            2)\n'
    assert code_lines(source) == 4
    with pytest.raises(ValueError, match="no such files"):
        lines_of_names("`kinematics/{limits,no_such}.py`", [PACKAGE])
