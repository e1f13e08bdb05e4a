"""Servo filters, each alone: its output for a step, a ramp and a sine; all come to rest on the last target."""
import math

import pytest
from plant_watch import ZU7, PlantWatch

from jaka_ros_driver.simulation.arm import servo_filters
from jaka_ros_driver.simulation.arm.events import TargetRejected
from jaka_ros_driver.simulation.arm.frames import ArmFrames
from jaka_ros_driver.simulation.arm.plant import CYCLE_TIME_S, HOME, Plant
from jaka_ros_driver.simulation.arm.profiles import RUCKIG
from jaka_ros_driver.simulation.arm.servo_filters import CoordinateTracker, ServoFilter, make_filter

PARAMETERS = {
    ServoFilter.NONE: {},
    ServoFilter.JOINT_LOW_PASS: {"lpf_cf": 2.0},
    ServoFilter.JOINT_LIMITS: {"nlf_max_vr": 1.0, "nlf_max_ar": 4.0, "nlf_max_jr": 80.0},
    ServoFilter.JOINT_MEAN: {"mmf_max_buf": 20, "mmf_kp": 0.2, "mmf_kv": 0.4, "mmf_ka": 0.2},
    ServoFilter.CARTESIAN_LIMITS: {"nlf_max_vp": 0.2, "nlf_max_ap": 1.0, "nlf_max_jp": 20.0,
                                   "nlf_max_vr": 1.0, "nlf_max_ar": 4.0, "nlf_max_jr": 80.0},
    ServoFilter.FORESIGHT: {"mmf_max_buf": 15, "mmf_kp": 0.03},
}
ALL = pytest.mark.parametrize("kind", list(ServoFilter))


def joints(first):
    return (first, *HOME[1:])


def response(kind, targets, **changes):
    """Return joint 1 after each cycle."""
    made = make_filter(kind, {**PARAMETERS[kind], **changes}, ArmFrames(ZU7), HOME)
    return [made.step(joints(target), CYCLE_TIME_S)[0] for target in targets]


def differences(values, start=0.0):
    return [(b - a) / CYCLE_TIME_S for a, b in zip([start, *values], values)]


@ALL
def test_comes_to_rest_on_the_last_target(kind):
    out = response(kind, [0.2] * 1500)
    assert out[-1] == pytest.approx(0.2, abs=1e-6)
    assert abs(out[-1] - out[-2]) < 1e-7


@ALL
def test_stays_where_nothing_changes(kind):
    assert response(kind, [0.0] * 50) == pytest.approx([0.0] * 50, abs=1e-12)


@ALL
def test_follows_a_ramp_at_its_speed(kind):
    out = response(kind, [0.3 * CYCLE_TIME_S * n for n in range(1200)])
    assert differences(out)[-1] == pytest.approx(0.3, rel=0.02)


def test_without_a_filter_the_target_goes_through():
    assert response(ServoFilter.NONE, [0.1, 0.05]) == [0.1, 0.05]


@pytest.mark.parametrize("cutoff", [0.5, 2.0, 10.0])
def test_low_pass_damps_a_sine_at_its_cutoff_by_3_db(cutoff):
    targets = [0.1 * math.sin(math.tau * cutoff * CYCLE_TIME_S * n) for n in range(int(12 / cutoff / CYCLE_TIME_S))]
    out = response(ServoFilter.JOINT_LOW_PASS, targets, lpf_cf=cutoff)
    assert max(out[len(out) // 2:]) / 0.1 == pytest.approx(1 / math.sqrt(2), rel=0.12)


def test_joint_limits_hold_on_a_step():
    out = response(ServoFilter.JOINT_LIMITS, [0.8] * 400)
    speeds = differences(out)
    assert max(speeds) == pytest.approx(1.0, abs=1e-6)
    assert max(map(abs, differences(speeds))) <= 4.0 * 1.001
    assert RUCKIG is None or max(map(abs, differences(differences(speeds)))) <= 80.0 * 1.01
    assert max(out) <= 0.8 + (1e-9 if RUCKIG is not None else 1e-4)


def test_cartesian_limits_hold_on_a_step():
    frames = ArmFrames(ZU7)
    made = make_filter(ServoFilter.CARTESIAN_LIMITS, PARAMETERS[ServoFilter.CARTESIAN_LIMITS], frames, HOME)
    target = (0.3, *HOME[1:])
    goal = frames.tool_at(target)
    tools = [frames.tool_at(HOME)] + [frames.tool_at(made.step(target, CYCLE_TIME_S)) for _ in range(500)]
    for axis in (9, 10, 11):
        speeds = differences([tool[axis] for tool in tools[1:]], tools[0][axis])
        assert max(map(abs, speeds)) <= 0.2 * 1.001
        assert max(map(abs, differences(speeds))) <= 1.0 * 1.001
    assert tools[-1] == pytest.approx(goal, abs=1e-6)


def test_foresight_lags_a_ramp_by_half_its_buffer_less_the_cycle_fed_forward():
    slope = 0.5 * CYCLE_TIME_S
    out = response(ServoFilter.FORESIGHT, [slope * n for n in range(1, 400)])
    assert slope * 399 - out[-1] == pytest.approx(slope * ((15 - 1) / 2 - 1), rel=0.01)


def test_mean_smooths_a_step_over_its_buffer():
    out = response(ServoFilter.JOINT_MEAN, [0.1] * 200, mmf_max_buf=40, mmf_kp=1.0, mmf_kv=0.0, mmf_ka=0.0)
    assert out[:40] == pytest.approx([0.1 * n / 40 for n in range(1, 41)])


@pytest.mark.parametrize("has_ruckig", [True, False])
def test_tracker_without_ruckig_keeps_speed_and_acceleration_too(has_ruckig, monkeypatch):
    if not has_ruckig:
        monkeypatch.setattr(servo_filters, "RUCKIG", None)
    tracker = CoordinateTracker((0.0,), (1.0, 4.0, 80.0))
    out = [tracker.step((0.5 if n < 150 else -0.5,), CYCLE_TIME_S)[0] for n in range(500)]
    speeds = differences(out)
    assert max(map(abs, speeds)) <= 1.0 + 1e-6
    assert max(map(abs, differences(speeds))) <= 4.0 * 1.001
    assert out[149] == pytest.approx(0.5, abs=1e-9)
    assert out[-1] == pytest.approx(-0.5, abs=1e-9)


@ALL
def test_streams_with_every_filter_end_on_their_last_target(kind):
    watch = PlantWatch(checks_acceleration=kind in (ServoFilter.JOINT_LIMITS, ServoFilter.JOINT_LOW_PASS))
    watch.plant.set_servo_filter(kind, **PARAMETERS[kind])
    assert watch.plant.enter_servo()
    for n in range(1, 101):
        watch.plant.servo_joint(joints(0.15 * (1.0 - math.cos(math.pi * n / 100))))
        watch.step()
    watch.step(600)
    assert watch.plant.joint_position[0] == pytest.approx(0.3, abs=1e-4)
    assert watch.plant.is_servo_active


@pytest.mark.parametrize(("kind", "parameters"), [
    (ServoFilter.NONE, {"lpf_cf": 1.0}),
    (ServoFilter.JOINT_LOW_PASS, {}),
    (ServoFilter.JOINT_LOW_PASS, {"lpf_cf": 0.0}),
    (ServoFilter.JOINT_LOW_PASS, {"lpf_cf": float("nan")}),
    (ServoFilter.JOINT_LIMITS, {"nlf_max_vr": 1.0, "nlf_max_ar": -4.0, "nlf_max_jr": 80.0}),
    (ServoFilter.JOINT_MEAN, {"mmf_max_buf": 0, "mmf_kp": 0.2, "mmf_kv": 0.4, "mmf_ka": 0.2}),
    (ServoFilter.JOINT_MEAN, {"mmf_max_buf": 10_000, "mmf_kp": 0.2, "mmf_kv": 0.4, "mmf_ka": 0.2}),
    (ServoFilter.FORESIGHT, {"mmf_max_buf": 15, "mmf_kp": 1.5}),
    (ServoFilter.FORESIGHT, {"mmf_max_buf": 15, "mmf_kp": 0.0}),
])
def test_bad_parameters_are_rejected_and_the_filter_stays(kind, parameters):
    plant = Plant(ZU7)
    with pytest.raises(TargetRejected):
        plant.set_servo_filter(kind, **parameters)
    plant.enter_servo()
    plant.servo_joint(joints(0.01))
    plant.step()
    assert plant.joint_position[0] == pytest.approx(0.01)
