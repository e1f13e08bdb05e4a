"""The capsules of each model: where they are, how thick, and which pairs can meet."""
import random

import dh_oracle
import draw_capsules
import pytest

from jaka_ros_driver.clearance.distances import point_in_base, segment_distance
from jaka_ros_driver.clearance.guard import MotionGuard
from jaka_ros_driver.clearance.shape import Capsule, arm_shape
from jaka_ros_driver.clearance.workspace import load_workspace
from jaka_ros_driver.kinematics.arm_models import ArmModel, DhRow, load_model, model_names
from jaka_ros_driver.kinematics.forward import link_transforms

EVERY_MODEL = pytest.mark.parametrize("name", model_names())


def gaps_of(model, joints, pairs):
    """Return the distance of each pair's surfaces, m."""
    shape, frames = arm_shape(model), link_transforms(model, joints)
    ends = [(point_in_base(frames[one.frame], one.start), point_in_base(frames[one.frame], one.end))
            for one in shape.capsules]
    return {pair: segment_distance(*ends[pair[0]], *ends[pair[1]])
            - shape.capsules[pair[0]].radius - shape.capsules[pair[1]].radius for pair in pairs}


@EVERY_MODEL
def test_the_parts_lead_from_the_base_to_the_flange(name):
    model, rng = load_model(name), random.Random(1)
    shape = arm_shape(model)
    assert shape.capsules[0].name == "the base" and shape.capsules[-1].name == "the flange"
    assert [one.frame for one in shape.capsules] == sorted(one.frame for one in shape.capsules)
    for _ in range(20):  # each part touches the one before it, whatever the joints are
        chain = [(n, n + 1) for n in range(len(shape.capsules) - 1)]
        assert all(gap < 0.0 for gap in gaps_of(model, dh_oracle.random_joints(model, rng), chain).values())


def test_the_four_parts_of_the_minicobo_hold_all_joints_and_the_links_between_them():
    # Links 3 and 4 turn about the axis of the forearm, 5 and 6 lie in the flange; the shoulder is in the base's top.
    model, rng = load_model("minicobo"), random.Random(4)
    shape = arm_shape(model)
    for _ in range(50):
        frames = link_transforms(model, dh_oracle.random_joints(model, rng))
        ends = [(point_in_base(frames[one.frame], one.start), point_in_base(frames[one.frame], one.end))
                for one in shape.capsules]
        origins = [frame[9:] for frame in frames]
        for start, end in zip(origins, origins[1:]):
            for share in (0.0, 0.25, 0.5, 0.75, 1.0):
                point = tuple(a + share * (b - a) for a, b in zip(start, end))
                assert min(segment_distance(point, point, *segment) - one.radius
                           for one, segment in zip(shape.capsules, ends)) < 1e-9


@EVERY_MODEL
def test_the_flange_ends_at_its_face_and_the_base_on_the_ground(name):
    base, flange = arm_shape(load_model(name)).capsules[0], arm_shape(load_model(name)).capsules[-1]
    assert base.start[2] == base.radius and base.frame == 0
    assert flange.end[2] == -flange.radius and flange.frame == 6


@EVERY_MODEL
def test_pairs_that_are_left_out_touch_always_or_never(name):
    model, rng = load_model(name), random.Random(2)
    shape = arm_shape(model)
    count = len(shape.capsules)
    out = [(n, m) for m in range(count) for n in range(m) if (n, m) not in shape.pairs
           and shape.capsules[m].frame - shape.capsules[n].frame >= 2]
    seen = [gaps_of(model, dh_oracle.random_joints(model, rng), out) for _ in range(300)]
    for n, m in out:
        gaps = [found[n, m] for found in seen]
        assert max(gaps) < 0.0 or min(gaps) > 0.0, (shape.capsules[n].name, shape.capsules[m].name)


@EVERY_MODEL
def test_some_random_positions_are_refused_and_most_are_not(name):
    model, rng = load_model(name), random.Random(3)
    guard = MotionGuard(model)
    refused = sum(bool(guard.trouble(dh_oracle.random_joints(model, rng))) for _ in range(1000))
    assert 3 <= refused <= 250


@EVERY_MODEL
def test_each_pair_that_counts_is_clear_in_the_pose_of_the_picture(name):
    model = load_model(name)
    assert MotionGuard(model).trouble(draw_capsules.usual_pose(model)) == ""


def test_a_calibrated_arm_has_the_shape_of_its_model():
    nominal = load_model("zu5")
    rows = tuple(DhRow(row.a and row.a + 1e-3, row.d and row.d - 1e-3, row.alpha, 1e-3) for row in nominal.dh)
    model = ArmModel(name="mine", family=nominal.family, dh=rows, joint_limits=nominal.joint_limits,
                     joint_max_speed=nominal.joint_max_speed)
    for mine, theirs in zip(arm_shape(model).capsules, arm_shape(nominal).capsules):
        assert mine.radius == pytest.approx(theirs.radius, rel=0.02)
        assert mine.start == pytest.approx(theirs.start, abs=5e-3) and mine.end == pytest.approx(theirs.end, abs=5e-3)


def test_a_tool_can_meet_all_that_does_not_carry_it():
    tool = Capsule("gripper", 6, (0.0, 0.0, 0.0), (0.0, 0.0, 0.15), 0.04)
    shape = arm_shape(load_model("zu7"), (tool,))
    assert shape.capsules[-1] == tool
    met = [shape.capsules[n].name for n, m in shape.pairs if m == len(shape.capsules) - 1]
    assert met == ["the base", "the shoulder", "the upper arm", "the elbow", "the forearm", "the wrist (link 4)"]


def test_the_picture_in_the_page_is_that_of_the_shapes():
    assert draw_capsules.PICTURE.read_text(encoding="utf-8") == draw_capsules.picture(), (
        "draw it anew: test/support/pages/draw_capsules.py")


def test_the_example_of_a_workspace_is_the_one_in_the_page_and_loads():
    path = draw_capsules.ROOT / "docs" / "examples" / "workspace.yaml"
    workspace = load_workspace(str(path))
    assert [zone.name for zone in workspace.keep_out] == ["press", "rack"] and workspace.floor == -0.1
    page = (draw_capsules.ROOT / "docs" / "motion_guard.md").read_text(encoding="utf-8")
    values = [line.split("#")[0].rstrip() for line in path.read_text(encoding="utf-8").splitlines()]
    assert "\n".join(filter(None, values)) in page
    guard = MotionGuard(load_model("zu7"), workspace)
    assert guard.trouble((0.0, 1.57, -1.57, 1.57, 1.57, 0.0)) == ""
