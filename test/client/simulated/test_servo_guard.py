"""The motion guard at servo targets of joints and poses, slow and fast: the arm is never nearer than its margin."""
import math
import random

import pytest
from simulated_arm import SimulatedArm

from jaka_ros_driver import commands as c
from jaka_ros_driver.clearance.guard import DEFAULT_MARGIN, MotionGuard
from jaka_ros_driver.clearance.workspace import NO_ZONES, workspace_of
from jaka_ros_driver.errors import InvalidCommand
from jaka_ros_driver.kinematics.arm_models import load_model
from jaka_ros_driver.kinematics.inverse import inverse
from jaka_ros_driver.kinematics.rotations import transform_from_pose
from jaka_ros_driver.simulation.arm.plant import HOME

MODEL = load_model("zu7")
CYCLE = 0.008
INTO_THE_BASE = (1.781, -0.866, -2.694, 0.38, 0.163, -3.141)
WALL = workspace_of({"keep_out": [{"name": "wall", "centre": [0.0, 0.7, 0.3], "size": [2.0, 0.6, 0.6]}]})
TABLE = workspace_of({"keep_out": [{"name": "table", "centre": [0.4, 0.0, 0.1], "size": [0.5, 1.0, 0.2]}]})
NEARER = 1e-4
"""Distance, m, by which a drawn stream may come nearer: the arm goes straight in poses, the look in joints."""


class Stream:
    """A simulated arm in servo mode, with the least distance that any cycle had.

    Attributes:
        arm: The arm.
        guard: Finds distances in its workspace.
        least: m.
        refusal: The text of the last refused target; "" where none was.
    """

    def __init__(self, workspace=NO_ZONES, joints=HOME, **settings):
        self.arm = SimulatedArm(MODEL, joints, has_all_fields=True, workspace=workspace, **settings)
        self.guard = MotionGuard(MODEL, workspace)
        assert self.arm.ended(self.arm.begin("servo_mode", True)) is None
        self.arm.run(0.2)
        self.least, self.refusal = math.inf, ""

    def take(self, target, seconds=CYCLE):
        """Send a target, then let time pass; return whether it was accepted."""
        self.refusal = ""
        try:
            self.arm.target(target)
        except InvalidCommand as error:
            self.refusal = str(error)
        self.rest(seconds)
        return not self.refusal

    def rest(self, seconds):
        """Let time pass, in steps of half a cycle at most."""
        for _ in range(math.ceil(2.0 * seconds / CYCLE - 1e-9)):
            self.arm.run(0.5 * CYCLE)
            self.least = min(self.least, self.guard.nearest(self.arm.joints).distance)

    def push(self, target_at, speed, acceleration, tries=40):
        """Send targets at a place that runs on until so many were refused; return the first text."""
        place = fast = 0.0
        refusals = []
        while len(refusals) < tries:
            fast = min(speed, fast + acceleration * CYCLE)
            if self.take(target_at(place + fast * CYCLE)):
                place += fast * CYCLE
            else:
                refusals.append(self.refusal)
        self.rest(0.5)
        return refusals[0]


def towards(end):
    """Return the joints' target at a place, rad of the fastest joint, on the straight way from ``HOME``."""
    way = [b - a for a, b in zip(HOME, end)]
    longest = max(map(abs, way))
    return lambda place: c.ServoJoint(tuple([a + place / longest * w for a, w in zip(HOME, way)]))


def shifted(arm, direction):
    """Return the pose target at a place, m, in this direction of the base from where the arm is."""
    state = arm.state
    return lambda place: c.ServoPose(c.Pose(tuple([p + place * d for p, d in zip(state.tcp_position, direction)]),
                                            state.tcp_rpy))


@pytest.mark.parametrize("speed", [0.05, 0.3, 0.8, 1.5, 2.0, 2.8])
@pytest.mark.parametrize("workspace, target_at, name", [
    (NO_ZONES, towards(INTO_THE_BASE), "the base"),
    (WALL, lambda place: c.ServoJoint((place,) + HOME[1:]), "the keep-out box 'wall'")])
def test_joint_targets_are_held_before_they_touch_at_every_speed_and_can_go_back(workspace, target_at, name, speed):
    stream = Stream(workspace)
    first = stream.push(target_at, speed, 10.0)
    assert first.startswith("refused: on the way to the servo target") and name in first
    assert DEFAULT_MARGIN - 1e-5 <= stream.least <= DEFAULT_MARGIN + 0.03
    if stream.arm.core.is_free:  # joints that brake at their own rates leave the line: the guard has ended it
        assert speed > 1.0
        assert stream.arm.ended(stream.arm.begin("servo_mode", True)) is None
        stream.rest(0.2)
    back = [a + 0.01 * (b - a) for a, b in zip(stream.arm.joints, HOME)]
    assert stream.take(c.ServoJoint(tuple(back)), 0.5) and stream.arm.joints == pytest.approx(back, abs=1e-4)
    assert stream.arm.ended(stream.arm.begin("servo_mode", False)) is None


@pytest.mark.parametrize("speed", [0.05, 0.1, 0.25, 0.5, 0.7, 1.0])
@pytest.mark.parametrize("workspace, direction, name", [
    (TABLE, (0.0, 0.0, -1.0), "the keep-out box 'table'"), (WALL, (0.0, 1.0, 0.0), "the keep-out box 'wall'"),
    (WALL, (-0.28, 0.96, 0.0), "the keep-out box 'wall'")])
def test_pose_targets_are_held_before_they_touch_at_every_speed_and_can_go_back(workspace, direction, name, speed):
    stream = Stream(workspace)
    back = c.Pose(stream.arm.state.tcp_position, stream.arm.state.tcp_rpy)
    first = stream.push(shifted(stream.arm, direction), speed, 6.0)
    assert first.startswith("refused: on the way to the servo target") and name in first
    assert DEFAULT_MARGIN - NEARER <= stream.least <= DEFAULT_MARGIN + 0.03
    if stream.arm.core.is_free:  # a joint brakes more slowly than the stream would: the guard has ended it
        assert speed > 0.1
        assert stream.arm.ended(stream.arm.begin("servo_mode", True)) is None
        stream.rest(0.2)
    here = stream.arm.state.tcp_position
    out = tuple([a + 0.02 * (b - a) / math.dist(here, back.position)
                 for a, b in zip(here, back.position)])
    assert stream.take(c.ServoPose(c.Pose(out, back.rpy)), 0.5), stream.refusal
    assert stream.arm.state.tcp_position == pytest.approx(out, abs=1e-4)


@pytest.mark.parametrize("speed, braking", [(0.8, 9.0), (2.0, 9.0), (2.0, 4.0)])
def test_a_client_that_brakes_by_itself_before_the_margin_is_not_held_up(speed, braking):
    stream, place, fast = Stream(WALL), 0.0, 0.0
    end = 0.0
    while stream.guard.nearest((end,) + HOME[1:]).distance > DEFAULT_MARGIN + 5e-4:
        end += 5e-4
    while end - place > 1e-6:
        fast = min(speed, fast + braking * CYCLE, math.sqrt(2.0 * braking * (end - place)))
        place = min(end, place + max(fast, 1e-3) * CYCLE)
        assert stream.take(c.ServoJoint((place,) + HOME[1:])), stream.refusal
    stream.rest(0.3)
    assert stream.arm.joints[0] == pytest.approx(end, abs=1e-4) and stream.least >= DEFAULT_MARGIN


@pytest.mark.parametrize("apart", [0.0, 0.004, CYCLE, 0.02])
def test_pose_targets_round_a_post_are_looked_at_from_where_the_arm_is_and_not_from_the_last_target(apart):
    x, y, z = SimulatedArm(MODEL, HOME, has_all_fields=True).state.tcp_position
    stream = Stream(workspace_of({
        "cylinders": [{"name": "post", "foot": [x, y + 0.022, 0.0], "height": z - 0.02, "radius": 0.005}],
        "tool": [{"name": "needle", "start": [0.0, 0.0, 0.0], "end": [0.0, 0.0, 0.08], "radius": 0.005}]}))
    rpy = stream.arm.state.tcp_rpy
    taken = [stream.take(c.ServoPose(c.Pose((x + dx, y + dy, z), rpy)), apart)
             for dx, dy in ((0.024, 0.0), (0.024, 0.044), (0.0, 0.044))]
    stream.rest(0.5)
    assert stream.least >= DEFAULT_MARGIN - NEARER and not all(taken)


def test_a_pose_stream_that_runs_out_of_reach_stands_within_it():
    stream = Stream()
    first = stream.push(shifted(stream.arm, (1.0, 0.0, 0.0)), 0.5, 6.0)
    assert "out of reach" in first and not stream.arm.core.is_free
    state = stream.arm.state
    pose = c.Pose(state.tcp_position, state.tcp_rpy)
    assert inverse(MODEL, transform_from_pose(pose), stream.arm.joints) == pytest.approx(stream.arm.joints, abs=1e-3)


@pytest.mark.parametrize("seed", range(12))
@pytest.mark.parametrize("is_pose", [False, True])
def test_drawn_streams_never_come_nearer_than_the_margin(is_pose, seed):
    # targets fast and slow, straight and round corners, with pauses, in a cell on all sides of the tool
    chance = random.Random(seed)
    x, y, z = SimulatedArm(MODEL, HOME, has_all_fields=True).state.tcp_position
    stream = Stream(workspace_of({"keep_out": [
        {"name": "wall", "centre": [x, y + 0.25, z], "size": [0.6, 0.2, 0.6]},
        {"name": "rack", "centre": [x + 0.3, y, z], "size": [0.2, 0.6, 0.6], "rpy": [0.0, 0.0, 0.2]},
        {"name": "table", "centre": [x, y, z - 0.25], "size": [0.6, 0.6, 0.2]}]}))
    rpy = stream.arm.state.tcp_rpy
    place, velocity = [0.0] * 6, [0.0] * 6
    taken = refused = 0
    for _ in range(600):
        if chance.random() < 0.04:
            fastest = chance.choice((0.2, 0.6) if is_pose else (0.5, 2.5))
            velocity = [chance.uniform(-fastest, fastest) * (1.0 if n < 3 else 0.3) for n in range(6)]
        wanted = [p + v * CYCLE for p, v in zip(place, velocity)]
        target = (c.ServoPose(c.Pose((x + wanted[0], y + wanted[1], z + wanted[2]),
                                     tuple([a + t for a, t in zip(rpy, wanted[3:])])))
                  if is_pose else c.ServoJoint(tuple([h + w for h, w in zip(HOME, wanted)])))
        if stream.take(target, chance.choice((0.004, CYCLE, CYCLE, CYCLE, 0.016))):
            place, taken = wanted, taken + 1
        else:
            refused += 1
            velocity = [-0.5 * v for v in velocity] if chance.random() < 0.3 else velocity
        if stream.arm.core.is_free:
            break
    stream.rest(0.5)
    assert stream.least >= DEFAULT_MARGIN - NEARER and taken > 30


def test_where_the_stream_itself_would_touch_the_guard_brakes_it_and_the_mode_ends_with_the_reason(monkeypatch):
    stream = Stream(WALL)
    monkeypatch.setattr("jaka_ros_driver.client.core.motion_guard.pose_guard.PoseGuard.target_trouble",
                        lambda guard, pose, end: "")  # a look at targets that misses everything
    target_at, place, braking = shifted(stream.arm, (0.0, 1.0, 0.0)), 0.0, ""
    while not stream.arm.core.is_free and place < 0.5:
        place += 0.5 * CYCLE
        if not stream.take(target_at(place)):
            braking = braking or stream.refusal
    assert "refused: the motion guard brakes this stream: " in braking and "'wall'" in braking
    stream.rest(0.5)
    assert stream.least >= DEFAULT_MARGIN - NEARER and not stream.arm.is_moving


def test_where_it_is_only_to_be_logged_pose_targets_go_on():
    stream = Stream(WALL, guard_motion="warn")
    target_at = shifted(stream.arm, (0.0, 1.0, 0.0))
    assert all(stream.take(target_at(0.001 * step)) for step in range(280))
    assert stream.least < 0.0


