"""Moves that are only accepted (~blocking false): queued, blended by mvradii, and their ends on ~motion_state."""
import contextlib
import os

import pytest
from action_bench import bow, nearest, tool_way
from driver_bench import HOME, SimulatorProcess, collecting
from import_graph import ROOT
from page_commands import Shell, blocks
from waiting import eventually
from wire_verdict import WireVerdict

from jaka_msgs.msg import MotionState

CORNER = [420.0, 100.0, 370.0]
TURN = [2.2214, -2.2214, 0.0]


@pytest.fixture(scope="module")
def arm(ros_node, driven_by, log_file):
    with contextlib.closing(SimulatorProcess("--start", "enabled", "--log", str(log_file))) as simulator:
        with driven_by(simulator, "blocking:=false") as arm:
            arm.wait_until_ready()
            yield arm


@pytest.fixture
def ends(arm):
    """Collect ~motion_state from now on: id to [(state, reason), ...]."""
    with collecting(arm.name + "/motion_state", MotionState) as received:
        yield lambda: {one: [(m.state, m.reason) for _, m in received if m.id == one] for _, last in received
                       for one in [last.id]}


def id_of(answer):
    assert answer.ret == 1 and answer.message.startswith("accepted, id "), answer
    return answer.message[len("accepted, id "):]


MISSED = 0.2
"""Excess, mm, of the distance at a corner where a busy host leaves a sample out: 0.1 mm were seen."""


def line(arm, x, y, radius=0.0, speed=200.0):
    return arm.call("linear_move", pose=[x, y, CORNER[2], *TURN], mvvelo=speed, mvacc=2000.0, mvradii=radius)


def done(ends, one):
    return eventually(lambda: ends().get(one, [(0, "")])[-1][0] != MotionState.ACCEPTED) and ends()[one]


def at_start(arm, ends):
    one = id_of(line(arm, CORNER[0] - 60.0, CORNER[1], speed=500.0))
    assert done(ends, one)[-1][0] == MotionState.COMPLETED, ends()


@pytest.fixture
def ready(arm, ends):
    one = id_of(arm.call("joint_move", pose=HOME, mvvelo=3.0, mvacc=12.0))
    assert done(ends, one)[-1][0] == MotionState.COMPLETED
    at_start(arm, ends)
    return arm


def tolerances(log_file, name):
    """Return those of the last two requests of this name; the log is written a little later than things happen."""
    return [request.get("tol") for _, request in WireVerdict(log_file).received() if request["cmdName"] == name][-2:]


def deviation(log_file, since):
    """Return (how near the tool came to the corner on straight lines from sample to sample, how far a line may be off),
    mm."""
    distance, index = nearest(tool_way(log_file, since), [v / 1000.0 for v in CORNER])
    return 1000.0 * distance, 0.05 * bow(log_file, since, index)


@pytest.mark.parametrize("radius", [0.0, 5.0, 20.0])
def test_the_corner_is_rounded_within_mvradii_and_each_call_has_its_end(ready, ends, log_file, radius):
    first = id_of(line(ready, CORNER[0], CORNER[1], radius))
    second = id_of(line(ready, CORNER[0], CORNER[1] + 60.0))
    assert int(second) == int(first) + 1
    assert done(ends, second) == [(MotionState.ACCEPTED, ""), (MotionState.COMPLETED, "the target is reached")]
    assert ends()[first] == [(MotionState.ACCEPTED, ""), (MotionState.COMPLETED, "the target is reached")]
    assert eventually(lambda: tolerances(log_file, "moveL") == [radius or 0.5, 0.5])
    near, off = deviation(log_file, WireVerdict(log_file).times_of("moveL")[-2])
    assert near <= max(radius, 0.5) + off + MISSED, "the corner is left by more than its radius"
    assert near > 0.2 * radius, "the corner is not rounded"


def test_a_stop_tells_every_call_of_the_queue_that_it_is_stopped(ready, ends):
    calls = [id_of(line(ready, CORNER[0], CORNER[1], 10.0, speed=20.0)),
             id_of(line(ready, CORNER[0], CORNER[1] + 60.0, speed=20.0))]
    assert eventually(ready.simulator.is_moving)
    ready.call("stop_move")
    for one in calls:
        state, reason = done(ends, one)[-1]
        assert state == MotionState.STOPPED and "stopped by request" in reason
    assert eventually(lambda: not ready.simulator.is_moving())


def test_a_refused_move_gets_no_id(ready, ends):
    before = dict(ends())
    answer = line(ready, 5000.0, 0.0)
    assert answer.ret == 0 and "id" not in answer.message
    for radius, reason in ((-1.0, "mvradii is -1"), (float("nan"), "mvradii"), (2000.0, "tolerance is 2 m")):
        answer = line(ready, CORNER[0], CORNER[1], radius)
        assert answer.ret == 0 and reason in answer.message, answer
    assert ends() == before


def test_joint_moves_carry_the_radius_only_where_there_is_one(ready, ends, log_file):
    for radius in (10.0, 0.0):
        one = id_of(ready.call("joint_move", pose=[0.1 + 0.001 * radius] + HOME[1:], mvvelo=3.0, mvacc=12.0,
                               mvradii=radius))
        assert done(ends, one)[-1][0] == MotionState.COMPLETED
    assert eventually(lambda: tolerances(log_file, "joint_move") == [pytest.approx(10.0), None])


def test_the_commands_of_the_page(ready, ends, root, tmp_path):
    (block,) = [block for block in blocks(ROOT / "docs" / "ros-interface.md") if block.note == "with blocking:=false"]
    (tmp_path / "build").symlink_to(root / "build")
    shell = Shell(tmp_path, dict(os.environ), ". build/devel/setup.bash")
    said = [shell.run(command) for command in block.text.strip().splitlines()]
    assert [code for code, _ in said] == [0, 0, 0], said
    assert "ret: 1" in said[0][1] and "accepted, id " in said[1][1]
    assert "id: " in said[2][1] and "state: " in said[2][1]
