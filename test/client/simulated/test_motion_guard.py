"""The motion guard in the driver's core: motions before they are sent, and while they last, in virtual time."""
import math
import re

import pytest
from simulated_arm import SimulatedArm

from jaka_ros_driver import commands as c
from jaka_ros_driver.clearance.guard import DEFAULT_MARGIN, MotionGuard, to_the_end
from jaka_ros_driver.clearance.workspace import NO_ZONES, workspace_of
from jaka_ros_driver.client.core.actions import Port
from jaka_ros_driver.client.core.motion import MotionOwner
from jaka_ros_driver.client.core.motion_guard.frame_guard import FrameGuard
from jaka_ros_driver.client.core.motion_guard.line_walk import corner_walks, walk
from jaka_ros_driver.client.core.motion_guard.tool_frames import ToolFrames
from jaka_ros_driver.client.core.point_stream import StreamPoint
from jaka_ros_driver.client.core.procedures import settings, zones
from jaka_ros_driver.client.core.trajectory import StartChanged
from jaka_ros_driver.client.core.velocity_jog.dead_man import JogMessage
from jaka_ros_driver.client.core.velocity_jog.ramp import Wish
from jaka_ros_driver.errors import ConnectionLost, InvalidCommand, MotionInterrupted, StopCause
from jaka_ros_driver.kinematics.arm_models import load_model
from jaka_ros_driver.kinematics.forward import forward
from jaka_ros_driver.kinematics.limits import JOINT_ACCELERATION_CEILING, SERVO_PERIOD_S
from jaka_ros_driver.kinematics.rotations import (
    IDENTITY,
    compose,
    matrix_from_rpy,
    pose_from_transform,
    transform,
    transform_from_pose,
)
from jaka_ros_driver.simulation.arm.plant import HOME
from jaka_ros_driver.trajectory.build import BuildOptions, build_path
from jaka_ros_driver.trajectory.points import JointTrajectory, TrajectoryPoint, TrajectoryTolerances

MODEL = load_model("zu7")
SETTING = MotionOwner.SETTING
GUARD = MotionGuard(MODEL)
TOOL = c.Pose((0.0, 0.02, 0.1), (0.1, 0.0, 0.5))
TURNED = c.Pose((0.1, -0.2, 0.05), (0.0, 0.0, 0.5 * math.pi))
CYCLE = 0.008
INTO_THE_BASE = (1.781, -0.866, -2.694, 0.38, 0.163, -3.141)


def simulated(joints=HOME, **settings):
    return SimulatedArm(MODEL, joints, has_all_fields=True, **settings)


def moved(arm, command):
    return arm.ended(arm.begin("move", command, True))


def names(arm):
    return {request["cmdName"] for _, request in arm.sent}


def near_its_margin(arm, guard=GUARD, within=0.03):
    """Return whether the arm rests, at least the margin away from everything, and no farther than ``within``, m."""
    return not arm.is_moving and DEFAULT_MARGIN - 1e-4 <= guard.nearest(arm.joints).distance <= DEFAULT_MARGIN + within


def share_of_the_way(share, end=INTO_THE_BASE):
    return tuple([a + share * (b - a) for a, b in zip(HOME, end)])


def ended_by_the_guard(error):
    return isinstance(error, MotionInterrupted) and error.cause is StopCause.MOTION_GUARD


LOW_TABLE = workspace_of({"keep_out": [{"name": "table", "centre": [0.4, 0.0, 0.1], "size": [0.5, 1.0, 0.2]}]})
LOW_GUARD = MotionGuard(MODEL, LOW_TABLE)


def line(arm, x=0.0, y=0.0, z=0.0, speed=0.2, turned=0.0):
    state = arm.state
    position = tuple(p + d for p, d in zip(state.tcp_position, (x, y, z)))
    rx, ry, rz = state.tcp_rpy
    return c.LinearMove(c.Pose(position, (rx, ry, rz + turned)), speed, 1.0)


# ---- before a motion ----

def test_a_joint_move_into_the_base_is_refused_with_place_and_pair_and_a_legal_one_goes():
    arm = simulated()
    error = moved(arm, c.JointMove(INTO_THE_BASE, 1.0, 4.0))
    assert isinstance(error, InvalidCommand)
    assert re.match(r"refused: after \d+ % of the way the flange is \d+ mm from the base; at least 10 mm are kept",
                    str(error)), error
    assert "joint_move" not in names(arm) and arm.core.is_free
    assert moved(arm, c.JointMove(share_of_the_way(0.7), 1.0, 4.0)) is None


@pytest.mark.parametrize("mode, is_logged", [("warn", True), ("off", False)])
def test_where_it_is_only_to_be_logged_or_not_looked_at_the_motion_goes(mode, is_logged):
    arm = simulated(guard_motion=mode)
    log = arm.core.actions.log
    told = []
    arm.core.actions.log = lambda level, text: (told.append(text), log(level, text))
    assert moved(arm, c.JointMove(INTO_THE_BASE, 1.0, 4.0)) is None
    assert any(text.startswith("sent, as ~guard_motion is warn: after ") for text in told) is is_logged


def test_a_queued_move_is_looked_at_from_the_end_of_the_one_before_it():
    arm = simulated()
    first = arm.begin("move", c.JointMove(share_of_the_way(0.7), 1.0, 4.0), False)
    refused = arm.begin("move", c.JointMove(share_of_the_way(0.85), 1.0, 4.0), False)
    assert first.error is None
    assert isinstance(refused.error, InvalidCommand) and "the flange is " in str(refused.error)
    back = arm.begin("move", c.JointMove(HOME, 1.0, 4.0), False)
    arm.until(lambda: arm.core.is_free)
    assert back.error is None and arm.joints == pytest.approx(HOME, abs=1e-4)


def test_a_queued_move_over_a_post_is_clear_from_the_lifted_end_of_the_one_before_it_only():
    post = {"name": "post", "foot": [0.2, 0.35, 0.0], "height": 0.5, "radius": 0.05}
    arm = simulated(workspace=workspace_of({"cylinders": [post]}))
    lifted = HOME[:2] + (-0.5,) + HOME[3:]
    beyond = (3.0,) + lifted[1:]
    assert "from the cylinder 'post'" in str(moved(arm, c.JointMove(beyond, 1.0, 4.0)))
    assert arm.begin("move", c.JointMove(lifted, 1.0, 4.0), False).error is None
    assert arm.begin("move", c.JointMove(beyond, 1.0, 4.0), False).error is None
    arm.until(lambda: arm.core.is_free)
    assert arm.joints == pytest.approx(beyond, abs=1e-4)


def test_a_queued_line_is_walked_from_the_end_of_the_joint_move_before_it():
    arm = simulated()
    away = (0.9,) + HOME[1:]
    end = pose_from_transform(forward(MODEL, away))
    assert arm.begin("move", c.JointMove(away, 1.0, 4.0), False).error is None
    lower = c.Pose((end.position[0], end.position[1], end.position[2] - 0.1), end.rpy)
    assert arm.begin("move", c.LinearMove(lower, 0.2, 1.0), False).error is None
    far = c.Pose((end.position[0], end.position[1], 2.0), end.rpy)
    refused = arm.begin("move", c.LinearMove(far, 0.2, 1.0), False)
    assert "its target cannot be reached" in str(refused.error)
    arm.until(lambda: arm.core.is_free)
    assert arm.state.tcp_position == pytest.approx(lower.position, abs=1e-4)


def test_a_target_out_of_reach_is_explained_and_not_sent():
    arm = simulated()
    error = moved(arm, line(arm, x=2.0))
    assert str(error).startswith("refused: its target cannot be reached: out of reach"), error
    assert "moveL" not in names(arm)


def test_a_line_into_a_zone_is_refused_with_its_place_in_mm():
    arm = simulated(workspace=LOW_TABLE)
    error = moved(arm, line(arm, z=-0.3))
    assert "from the keep-out box 'table'; at least 10 mm are kept" in str(error)
    assert str(error).startswith("refused: after ") and " mm of 300 mm " in str(error)
    assert moved(arm, line(arm, z=-0.05)) is None


@pytest.mark.parametrize("has_tool, has_user", [(True, False), (False, True), (True, True)])
def test_a_line_with_tool_and_user_frame_is_looked_at_with_both(has_tool, has_user):
    arm = simulated(workspace=LOW_TABLE)
    if has_tool:
        arm.does(lambda core: settings.set_tool_frame(core, c.SetToolFrame(2, TOOL, "long"), True), SETTING)
    if has_user:
        arm.does(lambda core: settings.set_user_frame(core, c.SetUserFrame(3, TURNED, "turned"), True), SETTING)
    both = has_tool and has_user
    if both:  # the feed alone shows the product of the two only
        place = arm.core.custody.motion_check.place_of(arm.state)
        assert place.frames is None
        arm.core.custody.motion_check.tools = tuple(
            transform_from_pose(pose) for pose in arm.does(lambda core: core.ask(c.Query.TOOL_FRAMES)))
    frames = arm.core.custody.motion_check.place_of(arm.state).frames
    assert frames.flange_t_tool == pytest.approx(transform_from_pose(TOOL) if has_tool else IDENTITY, abs=1e-4)
    assert frames.base_t_user == pytest.approx(transform_from_pose(TURNED) if has_user else IDENTITY, abs=1e-4)
    error = moved(arm, line(arm, z=-0.3))
    assert "from the keep-out box 'table'" in str(error), error
    assert moved(arm, line(arm, z=-0.05)) is None
    assert moved(arm, line(arm, x=0.05, y=-0.05)) is None


def test_a_path_is_looked_at_as_a_whole_before_its_first_segment():
    arm = simulated(workspace=LOW_TABLE)
    here = arm.state
    pose = c.Pose(here.tcp_position, here.tcp_rpy)
    down = c.Pose((pose.position[0], pose.position[1], pose.position[2] - 0.3), pose.rpy)
    side = c.Pose((pose.position[0], pose.position[1] + 0.1, pose.position[2]), pose.rpy)
    call = arm.begin("move_path", [c.LinearMove(side, 0.2, 1.0, 0.0), c.LinearMove(down, 0.2, 1.0, 0.0)],
                     lambda: False, lambda: None)
    error = arm.ended(call)
    assert str(error).startswith("segment 1: refused: after "), error
    assert "moveL" not in names(arm) and arm.core.is_free


def corner(arm, radius):
    """Return two lines around a corner of a right angle, the tool first beside and then down."""
    x, y, z = arm.state.tcp_position
    beside, down = (c.Pose((x, y + 0.2, z - lower), arm.state.tcp_rpy) for lower in (0.0, 0.2))
    return [c.LinearMove(beside, 0.2, 1.0, radius), c.LinearMove(down, 0.2, 1.0, 0.0)]


PEG = workspace_of({"keep_out": [{"name": "peg", "centre": [0.417, 0.245, 0.3075], "size": [0.03, 0.03, 0.1]}]})
"""A box within the corner, below the first line and beside the second one."""


@pytest.mark.parametrize("radius, is_refused", [(0.0, False), (0.02, False), (0.05, True), (0.08, True)])
def test_a_corner_whose_rounding_touches_a_zone_is_refused_where_the_sharp_one_is_clear(radius, is_refused):
    unguarded, guard, nearest = simulated(guard_motion="off"), MotionGuard(MODEL, PEG), 1.0
    call = unguarded.begin("move_path", corner(unguarded, radius), lambda: False, lambda: None)
    while not call.is_over:
        unguarded.run(CYCLE)
        nearest = min(nearest, guard.nearest(unguarded.joints).distance)
    assert (nearest < DEFAULT_MARGIN) is is_refused, "the way that the arm really takes"
    arm = simulated(workspace=PEG)
    error = arm.ended(arm.begin("move_path", corner(arm, radius), lambda: False, lambda: None))
    if not is_refused:
        assert error is None
        return
    assert re.match(r"segment 1: refused: on the rounded corner where it begins, after \d+ mm of \d+ mm the flange "
                    r".*keep-out box 'peg'", str(error)), error
    assert "moveL" not in names(arm)


@pytest.mark.parametrize("length, turn", [(0.0, 1.0), (0.1, 0.0), (0.1, 0.2), (0.05, 1.0)])
def test_a_line_is_looked_at_every_centimetre_and_every_twentieth_of_a_radian(length, turn):
    frames = ToolFrames(IDENTITY, IDENTITY)
    end = compose(frames.tool_at(MODEL, HOME), transform(matrix_from_rpy((0.0, 0.0, turn)), (0.0, 0.0, length)))
    way = walk(MODEL, frames, HOME, c.LinearMove(pose_from_transform(end), 0.2, 1.0, 0.0))
    for _ in way.looks():
        pass
    assert way.early_end is None and way.shares[-1] == 1.0
    longest = max(after - before for before, after in zip(way.shares, way.shares[1:]))
    assert longest * length <= 0.01 + 1e-9 and longest * turn <= 0.05 + 1e-9


def test_the_rounded_corner_of_queued_lines_is_looked_at():
    arm = simulated(workspace=PEG)
    first, second = corner(arm, 0.05)
    assert arm.begin("move", first, False).error is None
    assert "refused: on the rounded corner where it begins, " in str(arm.ended(arm.begin("move", second, False)))
    arm.until(lambda: arm.core.is_free)
    assert moved(arm, second) is None, "behind a stop at the corner it is sharp"


@pytest.mark.parametrize("radius", [0.0, 0.05])
def test_a_corner_that_touches_where_it_is_sharp_is_refused_however_it_is_rounded(radius):
    wall = {"name": "wall", "centre": [0.417, 0.367, 0.4], "size": [0.1, 0.03, 0.1]}
    arm = simulated(workspace=workspace_of({"keep_out": [wall]}))
    error = arm.ended(arm.begin("move_path", corner(arm, radius), lambda: False, lambda: None))
    assert re.match(r"segment 0: refused: after 19\d mm of 200 mm the flange .*'wall'", str(error)), error


def test_the_rounded_corners_that_are_looked_at_hold_the_way_of_the_simulated_controller():
    arm = simulated()
    first, second = corner(arm, 0.03)
    before = walk(MODEL, ToolFrames(IDENTITY, IDENTITY), HOME, first)
    to_the_end(before.looks())
    corners = corner_walks(before, walk(MODEL, ToolFrames(IDENTITY, IDENTITY), before.end, second))
    assert len(corners) == 2
    apex = [math.dist(one.tool(0.5)[9:], first.target.position) for one in corners]
    assert apex == pytest.approx([0.015, 0.03], abs=1e-6)
    call, places = arm.begin("move_path", [first, second], lambda: False, lambda: None), []
    while not call.is_over:
        arm.run(CYCLE)
        places.append(forward(MODEL, arm.joints)[9:])
    rounded = [corners[-1].tool(k / 500.0)[9:] for k in range(501)]
    near = [place for place in places if math.dist(place, first.target.position) < 0.06]
    assert len(near) > 20
    assert max(min(math.dist(place, other) for other in rounded) for place in near) < 1e-3


@pytest.mark.parametrize("tool, known, outside", [
    ((0.0, 0.0, 0.12), [], 120.0), ((0.0, 0.1, 0.1), [], None), ((0.0, 0.0, 0.03), [], 0.0), ((0.0, 0.0, 0.0), [], 0.0),
    ((0.0, 0.0, 0.2), [{"name": "gripper", "start": [0.0, 0.0, 0.0], "end": [0.0, 0.0, 0.16], "radius": 0.03}], 0.0)])
def test_a_tool_that_the_guard_does_not_see_is_told_once(tool, known, outside):
    arm = simulated(workspace=workspace_of({"tool": known}))
    log, told = arm.core.actions.log, []
    arm.core.actions.log = lambda level, text: (told.append(text), log(level, text))
    frame = c.SetToolFrame(2, c.Pose(tool, (0.0, 0.0, 0.0)), "long")
    arm.does(lambda core: settings.set_tool_frame(core, frame, True), SETTING)
    for _ in range(2):
        assert moved(arm, line(arm, z=0.01)) is None
    found = [text for text in told if "it does not see this tool" in text]
    assert len(found) == (outside != 0.0), told
    assert not outside or " %.0f mm outside of all parts" % outside in found[0]


def test_a_guard_that_fails_refuses_and_sends_nothing_unchecked():
    arm = simulated()

    def fails(*_):
        raise ZeroDivisionError("a defect")
    guard = arm.core.custody.motion_check._guard
    guard.looks = guard.first_trouble = guard.nearest = fails
    error = moved(arm, c.JointMove((0.2,) + HOME[1:], 1.0, 4.0))
    assert "the motion guard has failed" in str(error) and "a defect" in str(error) and "joint_move" not in names(arm)
    assert in_servo(arm) is None
    with pytest.raises(InvalidCommand, match="the motion guard has failed"):
        arm.target(c.ServoJoint((0.01,) + HOME[1:]))


def test_an_arm_in_trouble_moves_out_and_not_deeper():
    begin, deeper = share_of_the_way(0.8), share_of_the_way(0.85)
    assert GUARD.trouble(begin)
    arm = simulated(begin)
    assert isinstance(moved(arm, c.JointMove(deeper, 1.0, 4.0)), InvalidCommand)
    assert moved(arm, c.JointMove(HOME, 1.0, 4.0)) is None


# ---- other zones ----

def kept(arm, workspace):
    """Have the core keep this workspace as the service does; return what the arm is too near to where it stands."""
    return arm.does(lambda core: zones.keep(core, MotionGuard(MODEL, workspace)), SETTING)


def test_the_zones_that_were_set_last_are_kept_and_read_back():
    arm = simulated()
    down = line(arm, z=-0.3)
    assert arm.does(zones.kept) == NO_ZONES
    assert kept(arm, LOW_TABLE) == "" and arm.does(zones.kept) == LOW_TABLE
    assert "from the keep-out box 'table'" in str(moved(arm, down))
    assert kept(arm, NO_ZONES) == "" and arm.does(zones.kept) == NO_ZONES
    assert moved(arm, down) is None


def test_a_tool_that_is_set_counts_from_the_next_motion_on():
    arm = simulated(workspace=LOW_TABLE)
    assert moved(arm, line(arm, z=-0.05)) is None
    assert moved(arm, line(arm, z=0.05)) is None
    long_tool = LOW_TABLE._replace(tool=workspace_of({"tool": [
        {"name": "rod", "start": [0.0, 0.0, 0.0], "end": [0.0, 0.0, 0.1], "radius": 0.02}]}).tool)
    kept(arm, long_tool)
    assert "rod" in str(moved(arm, line(arm, z=-0.05)))


def test_a_stream_counts_with_the_reach_of_the_tool_that_was_set():
    arm = simulated()
    turned = HOME[:5] + (HOME[5] + 0.25,)
    tip = compose(forward(MODEL, turned), (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.9, 0.0, 0.0))[9:]
    kept(arm, workspace_of({
        "keep_out": [{"name": "bin", "centre": list(tip), "size": [0.06, 0.06, 0.06]}],
        "tool": [{"name": "rod", "start": [0.1, 0.0, 0.0], "end": [0.9, 0.0, 0.0], "radius": 0.01}]}))
    look = arm.core.custody.motion_check.look()
    assert look((HOME, HOME)) == ""
    assert "'bin'" in look((HOME, turned))


@pytest.mark.parametrize("stream", ["a move", "servo mode"])
def test_while_a_motion_is_in_custody_zones_are_not_changed_and_can_be_read(stream):
    arm = simulated(workspace=LOW_TABLE)
    if stream == "a move":
        arm.begin("move", c.JointMove((0.5,) + HOME[1:], 0.2, 1.0), True)
        assert arm.until(lambda: arm.is_moving, 1.0)
    else:
        assert in_servo(arm) is None
    with pytest.raises(InvalidCommand, match="owns the arm's motion"):
        kept(arm, NO_ZONES)
    assert arm.does(zones.kept) == LOW_TABLE


@pytest.mark.parametrize("fields", [{"emergency_stop": 1}, {"powered_on": 0, "enabled": False}, {"protective_stop": 1}])
def test_on_an_arm_that_cannot_move_zones_are_changed(fields):
    arm = simulated()
    arm.show(**fields)
    arm.run(0.2)
    assert kept(arm, LOW_TABLE) == "" and arm.does(zones.kept) == LOW_TABLE


def test_an_arm_that_stands_in_a_new_zone_is_told_so_and_moves_out_and_not_deeper():
    arm = simulated()
    box = workspace_of({"keep_out": [{"name": "bin", "centre": list(arm.state.tcp_position), "size": [0.2, 0.2, 0.2]}]})
    assert re.match(r"the \S.* runs \d+ mm into the keep-out box 'bin'", kept(arm, box))
    assert arm.does(zones.kept) == box
    assert isinstance(moved(arm, line(arm, z=-0.05)), InvalidCommand)
    assert moved(arm, line(arm, z=0.2)) is None


def test_without_a_state_of_the_arm_zones_stay_as_they_are():
    arm = simulated(workspace=LOW_TABLE)
    arm.cut(Port.STATUS, refused_for=10.0)
    arm.run(2.0)
    with pytest.raises(ConnectionLost):
        kept(arm, NO_ZONES)
    assert arm.does(zones.kept) == LOW_TABLE


def test_a_trajectory_that_was_looked_at_with_other_zones_does_not_begin():
    arm = simulated()
    arm.core.trajectory_start("start", 0.016, 0, arm.now)
    arm._perform()
    start, _ = arm.answers.pop("start")
    end = (0.1,) + HOME[1:]
    path = build_path(start.begin, JointTrajectory((TrajectoryPoint(2.0, end, (0.0,) * 6),)), 0.0, MODEL,
                      BuildOptions(0.01))
    kept(arm, LOW_TABLE)
    tolerances = TrajectoryTolerances((0.02,) * 6, (0.001,) * 6, 0.5)
    assert isinstance(arm.ended(arm.begin("follow", path, start, tolerances, 0)), StartChanged)
    assert arm.core.is_free and "servo_j" not in names(arm)


# ---- while it moves ----

def test_a_frame_guard_brakes_on_a_line_with_the_joints_acceleration_to_where_it_had_looked():
    ways = []

    def look(way):
        ways.append(way)
        return "a wall" if way[1][0] > 0.1 else ""
    guard = FrameGuard(look, (0.0,) * 6)
    speed, at, sent = 0.0, 0.0, [0.0]
    while not guard.trouble:
        speed = min(speed + 0.0008, 0.012)
        at += speed
        sent.append(guard.admitted((at, 0.5 * at, 0.0, 0.0, 0.0, 0.0))[0])
    while not guard.is_standing:
        joints = guard.braked()
        assert joints[1] == pytest.approx(0.5 * joints[0], abs=1e-12)
        sent.append(joints[0])
    steps = [b - a for a, b in zip(sent, sent[1:])]
    largest_change = JOINT_ACCELERATION_CEILING * SERVO_PERIOD_S ** 2
    assert max(abs(b - a) for a, b in zip(steps, steps[1:])) <= largest_change * 1.001
    assert sent[-1] == pytest.approx(ways[-2][2][0], abs=1e-9), "the stand of the last frame that was admitted"


def test_a_frame_guard_brakes_in_no_more_cycles_than_the_acceleration_needs():
    largest_change = JOINT_ACCELERATION_CEILING * SERVO_PERIOD_S ** 2
    for cycles in range(1, 31):
        guard = FrameGuard(lambda way: "a wall" if way[0][0] else "", (0.0,) * 6)
        for frame in (1, 2):
            guard.admitted((frame * cycles * largest_change,) + (0.0,) * 5)
        for _ in range(cycles - 1):
            assert not guard.is_standing
            guard.braked()
        assert guard.is_standing


def in_servo(arm, active=True):
    return arm.ended(arm.begin("servo_mode", active))


def jogged(arm, wish, seconds):
    """Hold a velocity jog: a message of rest, then this wish every 20 ms."""
    rest = wish._replace(velocity=(0.0,) * 6)
    for number in range(int(seconds / 0.02)):
        now = arm.now
        try:
            arm.core.jog_velocity(JogMessage("pad", int(1e9 * now), 0.0, now, wish if number > 5 else rest), now)
        except InvalidCommand as error:
            return str(error)
        finally:
            arm._perform()
        arm.run(0.02)
    return ""


@pytest.mark.parametrize("speed", [0.05, 0.25, 0.5])
def test_a_velocity_jog_into_the_arm_itself_stands_before_it_touches(speed):
    arm = simulated()
    way = [b - a for a, b in zip(HOME, INTO_THE_BASE)]
    wish = Wish(c.JogFrame.JOINT, tuple([speed * w / max(map(abs, way)) for w in way]))
    reason = jogged(arm, wish, 1.0 + 3.2 / speed)
    assert "a message of zero velocity must come first (the flange is " in reason, reason
    arm.until(lambda: arm.core.is_free)
    assert near_its_margin(arm)
    back = wish._replace(velocity=tuple([-v for v in wish.velocity]))
    assert jogged(arm, back, 1.0) == "", "out it may go"


@pytest.mark.parametrize("speed", [0.1, 0.25])
def test_a_velocity_jog_of_the_tool_into_a_zone_stands_before_it(speed):
    arm = simulated(workspace=LOW_TABLE)
    reason = jogged(arm, Wish(c.JogFrame.BASE, (0.0, 0.0, -speed, 0.0, 0.0, 0.0)), 1.0 + 0.4 / speed)
    assert "from the keep-out box 'table'" in reason
    arm.until(lambda: arm.core.is_free)
    assert near_its_margin(arm, LOW_GUARD)


def test_a_stream_of_points_into_the_arm_itself_is_held_before_it():
    arm = simulated()
    share, error = 0.0, None
    while error is None:
        share += 0.004
        call = arm.begin("follow_point", StreamPoint(share_of_the_way(share), arm.now + 0.05), arm.core.stops)
        arm.run(0.02)
        error = call.error
        assert share < 1.0 and GUARD.nearest(arm.joints).distance >= DEFAULT_MARGIN - 1e-6
    assert "refused: on the way to the point the flange is " in str(error)
    arm.until(lambda: arm.core.is_free)
    assert near_its_margin(arm)


WALL = workspace_of({"keep_out": [{"name": "wall", "centre": [0.417, 0.262, 0.3], "size": [0.5, 0.2, 0.6]}]})
"""A wall beside the flange of an arm at HOME, some mm farther away than the margin, towards the base's y."""
BASE, JOINT, TOOL_FRAME = c.JogFrame.BASE, c.JogFrame.JOINT, c.JogFrame.TOOL


@pytest.mark.parametrize("frame, axis, velocity, has_user", [
    (JOINT, 0, 0.3, False), (BASE, 1, 0.25, False), (BASE, 0, 0.25, True), (TOOL_FRAME, None, 0.25, False)])
def test_a_jog_that_begins_beside_a_wall_is_refused_towards_it_and_goes_away_from_it(frame, axis, velocity, has_user):
    arm = simulated(workspace=WALL)
    guard = MotionGuard(MODEL, WALL)
    assert DEFAULT_MARGIN < guard.nearest(HOME).distance < DEFAULT_MARGIN + 0.012
    if has_user:
        arm.does(lambda core: settings.set_user_frame(core, c.SetUserFrame(3, TURNED, "turned"), True), SETTING)
    if axis is None:  # the axis of the tool that lies along the base's y, and its sense
        along = forward(MODEL, HOME)[3:6]
        axis = max(range(3), key=lambda n: abs(along[n]))
        velocity = math.copysign(velocity, along[axis])
    error = arm.ended(arm.begin("jog", c.Jog(frame, axis, velocity)))
    assert re.match(r"refused: where the jog would lead, the \S.* keep-out box 'wall'", str(error)), error
    assert "jog" not in names(arm) and arm.core.is_free
    assert arm.ended(arm.begin("jog", c.Jog(frame, axis, -velocity))) is None
    arm.run(0.2)
    assert guard.nearest(arm.joints).distance > guard.nearest(HOME).distance + 0.003


def test_a_jog_whose_direction_cannot_be_known_is_watched_by_the_feed_alone():
    arm = simulated(workspace=WALL)
    arm.does(lambda core: settings.set_tool_frame(core, c.SetToolFrame(2, TOOL, "long"), True), SETTING)
    arm.does(lambda core: settings.set_user_frame(core, c.SetUserFrame(3, TURNED, "turned"), True), SETTING)
    arm.core.custody.motion_check.tools = None
    assert arm.ended(arm.begin("jog", c.Jog(BASE, 0, 0.05))) is None
    arm.until(lambda: arm.core.is_free)
    assert arm.times_of("stop_program") and MotionGuard(MODEL, WALL).nearest(arm.joints).distance > 0.005


def test_a_jog_beside_a_wall_goes_where_that_is_only_logged():
    arm = simulated(workspace=WALL, guard_motion="warn")
    told, log = [], arm.core.actions.log
    arm.core.actions.log = lambda level, text: (told.append(text), log(level, text))
    assert arm.ended(arm.begin("jog", c.Jog(BASE, 1, 0.25))) is None
    arm.run(0.3)
    assert sum("'wall'" in text for text in told) == 1


RINGS = workspace_of({"cylinders": [
    {"name": "ring %d" % n, "foot": [0.0, 0.0, -1.0], "height": 4.0, "radius": 0.2 + 0.01 * n} for n in range(50)]})
"""Cylinders around the axis of joint 1, in which the arm stands: it may turn about it, and each turn is a long look."""


def test_a_move_behind_one_that_is_looked_at_keeps_its_place_in_the_queue():
    arm = simulated(workspace=RINGS)
    places = [(HOME[0] + angle,) + HOME[1:] for angle in (-0.2, -0.7, -0.22)]
    first = arm.begin("move", c.JointMove(places[0], 0.05, 2.0), False)
    assert arm.until(lambda: first.is_over) and first.error is None
    second = arm.begin("move", c.JointMove(places[1], 1.0, 4.0), False)
    assert not second.is_over, "it is being looked at"
    third = arm.begin("move", c.JointMove(places[2], 1.0, 4.0), False)
    arm.until(lambda: arm.core.is_free)
    assert second.error is None and third.error is None
    targets = [request["jointPosition"][0] for _, request in arm.sent if request["cmdName"] == "joint_move"]
    assert targets == pytest.approx([math.degrees(place[0]) for place in places], abs=1e-3)


def test_a_look_while_it_moves_takes_few_distances_or_says_that_it_would_need_more():
    arm = simulated(workspace=RINGS)
    check = arm.core.custody.motion_check
    looks, ends = [], check._guard._ends
    check._guard._ends = lambda *of: looks.append(of) or ends(*of)
    turned = (HOME[0] + 3.0,) + HOME[1:]
    assert "it has taken 4000 distances" in check.look()((HOME, turned))
    assert len(looks) < 100
    assert check.look()((HOME, (HOME[0] + 0.02,) + HOME[1:])) == "", "what is looked at to its end is clear"


@pytest.mark.parametrize("speed", [0.1, 0.5, 1.5])
def test_a_jog_of_the_controller_is_stopped_before_a_zone(speed):
    arm = simulated(workspace=LOW_TABLE, guard_motion="stop")
    jog = c.Jog(c.JogFrame.JOINT, 1, -speed)
    while arm.core.is_free or arm.is_moving:
        call = arm.begin("jog", jog)
        assert call.error is None
        arm.run(0.1)
        if arm.times_of("stop_program"):
            break
        assert arm.now < 140.0
    arm.until(lambda: arm.core.is_free)
    assert near_its_margin(arm, LOW_GUARD, 0.25), LOW_GUARD.nearest(arm.joints)
