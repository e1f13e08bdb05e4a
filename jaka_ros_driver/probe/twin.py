"""The simulated arm that a report makes: how it is to accelerate, and how far it then is from the arm that was seen.

The curves of the stage move are what it is made of: two motions and the ways home for the fit, and two others to
compare with.
"""
import bisect
import math
from typing import Dict, List, NamedTuple, Optional, Sequence, Tuple

from jaka_ros_driver.kinematics.arm_models import load_model, model_names
from jaka_ros_driver.probe.facts import Fact, Facts
from jaka_ros_driver.probe.fit import LEAST_FRAMES, Fit, SampledCurve, SeenMotion, delay_of, fitted, progress, times_of
from jaka_ros_driver.probe.recorded import quantile
from jaka_ros_driver.probe.report import dialect_of, firmware_of
from jaka_ros_driver.simulation.arm.moves import braking_share
from jaka_ros_driver.simulation.arm.plant import CYCLE_TIME_S, Plant
from jaka_ros_driver.simulation.dialect.table import Dialect
from jaka_ros_driver.units import deg_to_rad, rad_to_deg

MOVE, OUT, BACK, STOP, RETURN = "move", "out", "back", "stop", "return"
"""Names of the curves. Times count from the acceptance of ``out`` and ``back``, and from the sending of the stop.

The ways home after the steps are returns: a number follows the word.
"""
WITHIN = 0.95
"""Share of the frames that are within the stated error."""
POOR_SHARE = 0.1
"""Error, as a share of the way, beyond which the twin is called otherwise."""
_SAME_DELAY_S = 0.15
"""Largest difference, s, of beginnings that tell the same delay."""
_LONGEST_S = 60.0
"""Longest simulated motion, s; a twin that never arrives is compared up to here."""
_MIDDLE = 0.1
"""Share of the way, at both ends, that is too slow to tell a time by."""
_DEFAULT_MODEL = "zu7"


class AskedMotion(NamedTuple):
    """The speed and the acceleration that a motion was asked for: deg/s, deg/s2."""

    speed: float
    acceleration: float


class TwinGap(NamedTuple):
    """The distance of two motions, in 95 of 100 frames: deg, s; and their way, deg."""

    degrees: float
    seconds: float
    way: float


def twin_facts(facts: Facts, curves: Dict[str, SampledCurve], asked: Dict[str, AskedMotion]) -> Facts:
    """Return what the curves say of acceleration and jerk, and how far the twin of these facts is from the arm.

    Args:
        facts: Those of the probe.
        curves: Those of the stage move: s, deg.
        asked: What each was asked to do.
    """
    motions = [SeenMotion(curves[name], *asked[name]) for name in (OUT, MOVE) if len(curves.get(name, ())) > 2]
    returns = [SeenMotion(curve, *asked[RETURN]) for name, curve in curves.items() if name.startswith(RETURN)]
    fit = fitted(motions, returns) if len(motions) == 2 else None
    found = _fit_facts(fit, len(motions), len(returns))
    unsure = 0.0
    if fit is not None and fit.has_share and len(curves.get(BACK, ())) > 2:
        found["start_delay"], unsure = _start_delay(facts, [
            max(0.0, delay_of(motion, fit)) for motion in (motions[0], SeenMotion(curves[BACK], *asked[BACK]))])
    gaps = _gaps({**facts, **found}, curves, asked)
    if not gaps:
        why = Fact(None, "the motions to compare with were not seen whole, or no firmware is near")
        return {**found, "twin_angle": why, "twin_time": why}
    degrees = max(gap.degrees for gap in gaps) + unsure * asked[BACK].speed
    seconds = max(gap.seconds for gap in gaps) + unsure
    how = "%d of 100 frames of a move of %.1f deg%s, which the fit has not seen" % (
        round(100.0 * WITHIN), gaps[0].way, " and of a stop" if len(gaps) > 1 else "")
    if fit is None or unsure > _SAME_DELAY_S or any(gap.degrees > POOR_SHARE * gap.way for gap in gaps[:1]):
        why = Fact(None, "it moves otherwise: %.3f deg and %.0f ms in %s" % (degrees, 1000.0 * seconds, how))
        return {**found, "twin_angle": why, "twin_time": why}
    return {**found, "twin_angle": Fact(_rounded_up(degrees, 0.001), how),
            "twin_time": Fact(_rounded_up(seconds, 0.001), how)}


def _start_delay(facts: Facts, begun: Sequence[float]) -> Tuple[Fact, float]:
    """Return the start delay by the beginnings, s, of two curves and by the fact found before, and their range.

    Frames that come late make a difference between them; that much the twin may be off without a frame that shows it.
    """
    before = facts.get("start_delay", Fact(None, "")).value
    values = [*begun, *([before] if before is not None else [])]
    how = "where the curves of two moves begin after the reply, and where a frame first showed a third: %s s" % (
        ", ".join("%.3f" % value for value in values))
    if max(values) - min(values) > _SAME_DELAY_S:
        return Fact(None, how + "; this computer or the network is busy"), max(values) - min(values)
    return Fact(round(min(values), 3), how), max(values) - min(values)


def _rounded_up(value: float, step: float) -> float:
    return round(math.ceil(value / step) * step, 6)


def _fit_facts(fit: Optional[Fit], moves: int, returns: int) -> Facts:
    if fit is None:
        why = ("no acceleration and jerk fit the curves of two moves, or one has fewer than %d frames" % LEAST_FRAMES
               if moves == 2 else "two moves were not seen whole")
        return {name: Fact(None, why) for name in ("move_acceleration", "move_jerk_time")}
    how = "the curves of two moves and %d ways home, %.2f %% of the way off in the mean" % (
        returns, 100.0 * fit.misfit)
    shares = "%.2f to %.2f fit as well" % fit.shares
    jerks = "%.2f to %.2f s fit as well" % fit.jerk_times
    return {"move_acceleration": Fact(round(fit.share, 3), how, shares) if fit.has_share else Fact(
                None, "%s; %s" % (how, shares)),
            "move_jerk_time": Fact(round(fit.jerk_time, 3), how, jerks) if fit.has_jerk_time else Fact(
                None, "%s; %s" % (how, jerks))}


def _gaps(facts: Facts, curves: Dict[str, SampledCurve], asked: Dict[str, AskedMotion]) -> List[TwinGap]:
    """Return the gaps of the way back, and where it was seen of the stop."""
    firmware = firmware_of(facts)
    if not firmware or len(curves.get(BACK, ())) < LEAST_FRAMES:
        return []
    dialect = Dialect.default(firmware).replaced(dialect_of(facts))
    value = facts.get("model", Fact(None, "")).value
    model = value[0] if isinstance(value, list) and value and value[0] in model_names() else _DEFAULT_MODEL
    rate = facts.get("stop_deceleration", Fact(None, "")).value
    seen = progress(curves[BACK])
    gaps = [gap(seen, twin_motion(dialect, model, rate, seen[-1][1], asked[BACK], None))]
    stop = progress(curves[STOP]) if len(curves.get(STOP, ())) > 2 else []
    before = [place for at, place in stop if at <= 0.0]
    if before and before[-1] > 0.0 and facts.get("stop_ends_move", Fact(None, "")).value is True:
        made = twin_motion(dialect, model, rate, 2.0 * stop[-1][1], asked[STOP], before[-1])
        gaps.append(gap([(at, place) for at, place in stop if at > 0.0], made))
    return [one for one in gaps if one is not None]


def twin_motion(dialect: Dialect, model: str, stop_deceleration: Optional[float], way: float, asked: AskedMotion,
                stop_at: Optional[float]) -> SampledCurve:
    """Return a motion of joint 6 of the simulated arm from its acceptance, or from where it is stopped: s, deg.

    Args:
        dialect: Of the simulated controller.
        model: Name of the arm's model.
        stop_deceleration: As ``LikeController`` has it, deg/s2.
        way: deg.
        asked: Speed and acceleration.
        stop_at: Place, deg, at which it is stopped; None for nowhere.
    """
    arm = load_model(model)
    plant = Plant(arm)
    plant.acceleration_share, plant.queue.jerk_seconds = dialect.move_acceleration, dialect.move_jerk_time
    plant.queue.start_delay = 0.0 if stop_at is not None else dialect.start_delay
    plant.queue.braking_share = braking_share(
        arm, None if stop_deceleration is None else deg_to_rad(stop_deceleration))
    begun = plant.joint_position
    plant.add_joint_move((*begun[:5], begun[5] + deg_to_rad(way)), deg_to_rad(asked.speed),
                         deg_to_rad(asked.acceleration))
    points: SampledCurve = [(0.0, 0.0)]
    while points[-1][0] < _LONGEST_S and not (plant.queue.is_empty and plant.is_in_position):
        plant.step()
        place = rad_to_deg(plant.joint_position[5] - begun[5])
        points.append((points[-1][0] + CYCLE_TIME_S, place))
        if stop_at is not None and place >= stop_at:
            plant.stop()
            points, stop_at = [(0.0, place)], None
    return points


def place_at(curve: Sequence[Tuple[float, float]], at: float) -> float:
    """Return where a motion is at a moment, between its points; it rests before the first and after the last."""
    n = bisect.bisect_right([moment for moment, _ in curve], at)
    if n == 0 or n == len(curve):
        return curve[0][1] if n == 0 else curve[-1][1]
    (t0, p0), (t1, p1) = curve[n - 1], curve[n]
    return p0 + (p1 - p0) * (at - t0) / (t1 - t0) if t1 > t0 else p1


def gap(seen: Sequence[Tuple[float, float]], made: Sequence[Tuple[float, float]]) -> Optional[TwinGap]:
    """Return how far frames are from a motion on the same clock; None where no frame shows the motion.

    Args:
        seen: Frames: s, deg, which grow.
        made: The motion: s, deg, which grow.
    """
    first, last = min(seen[0][1], made[0][1]), max(seen[-1][1], made[-1][1])
    low, high = first + 0.005 * (last - first), last - 0.005 * (last - first)
    frames = [(at, place) for at, place in seen if low < place < high or low < place_at(made, at) < high]
    if not frames:
        return None
    distances = [abs(place - place_at(made, at)) for at, place in frames]
    begin, way = made[0][0], made[-1][1] - made[0][1]
    edge = _MIDDLE * way
    middle = sorted((place, at) for at, place in frames if made[0][1] + edge < place < made[-1][1] - edge)
    duration = made[-1][0] - begin
    passed = times_of(lambda seconds: place_at(made, begin + seconds) - made[0][1], duration, way,
                      [place - made[0][1] for place, _ in middle]) if middle else []
    times = [abs(at - begin - when) for (_, at), (when, _) in zip(middle, passed)]
    return TwinGap(_bound(distances), _bound(times) + CYCLE_TIME_S, last - first)  # how old a frame was is not known


def _bound(values: Sequence[float]) -> float:
    """Return what 95 of 100 values are below, of those that these are a sample of: of few frames the largest."""
    return quantile(values, WITHIN + 1.64 * math.sqrt(WITHIN * (1.0 - WITHIN) / len(values))) if values else 0.0
