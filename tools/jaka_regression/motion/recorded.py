"""The joints of a log: which topic, which part of the time, and whether they can have been one motion."""
from typing import List, NamedTuple, Optional, Tuple

import numpy as np

from jaka_bag.compare.runs.run import LongTrack, Run
from jaka_bag.driver_interface import JOINT_SPEED_CEILING, JOINTS
from jaka_bag.errors import BagError, UsageError
from jaka_bag.messages.batch import Array
from jaka_bag.units import NS_PER_S

LONGEST_GAP_S = 0.2
"""Longest silence that is bridged, s; what an arm does in a longer one is not known."""
_GAP_INTERVALS = 3.0
"""A feed that is slow throughout has no gaps: so many of its median intervals are none."""
_FEWEST = 10
"""Fewest samples of a motion."""
_STILL_RAD = 0.005
"""Distance over a silence, rad, up to which an arm is taken to have stood still meanwhile."""
_EVEN_SHARE = 0.98
"""Share of the usual period by which two samples were apart at least: the clocks of two computers differ by less."""
_LONGEST_HOLD_S = 0.5
"""Longest time, s, that samples can be held up; later ones were measured at another rate than most of the log."""
_WINDOW = 1000
"""Samples over which one period and phase hold: 8 s at 125 Hz, in which clocks hardly drift."""
_PERIODS = 1.0 + np.linspace(-0.03, 0.03, 401)
"""Periods that are tried, as shares of the usual one, which is a median and so a little off."""
_PUNCTUAL_TURN = 0.25
"""Share of a period by which a sample may be late and still counts as measured at a whole period."""
_CONCENTRATION = 0.3
"""Length of the mean of all phases as unit vectors: 1 where all samples came at whole periods, 0 where at any time."""
_LONGEST_HOLE_S = 0.1
"""Longest hole, s, that leaving out late samples may make."""
_JUMP_RAD = 0.05
"""Way, rad, beside that at the highest speed, beyond which a step is a jump: noise and late stamps are less."""
_JUMP_S = 0.05
"""Allowance for jumps, s: stamps give the time of arrival, which a busy host delays."""


class Recording(NamedTuple):
    """Joint positions over time, all finite, at times that rise.

    Attributes:
        path: The log.
        topic: Topic of the positions.
        names: Names of the joints, without a prefix: ``JOINTS``.
        time: Times, s since the log's first message, (n,).
        position: Positions, rad (n, 6), joint 1 first.
    """

    path: str
    topic: str
    names: Tuple[str, ...]
    time: Array
    position: Array

    @property
    def node(self) -> str:
        """The driver that published them, as its topics are named."""
        namespace, _, name = self.topic.rpartition("/")
        return namespace if name == "joint_position" else namespace + "/jaka_driver"

    @property
    def interval(self) -> float:
        """The median time between two samples, s."""
        return float(np.median(np.diff(self.time)))


def recorded_joints(run: Run, topic: Optional[str] = None, start_ns: Optional[int] = None,
                    end_ns: Optional[int] = None, longest_gap: float = LONGEST_GAP_S) -> Recording:
    """Return the joint positions of a log that are to be replayed.

    Args:
        run: The log.
        topic: Topic of the positions; None where the log has only one.
        start_ns: Log time of the beginning, ns since the epoch.
        end_ns: Log time of the end, ns since the epoch.
        longest_gap: Silences up to this length are bridged, s.

    Raises:
        BagError: There are none, too few, or they are no single motion: the message names the time and the joint.
        UsageError: Several topics have joint positions, and none was named.
    """
    whole = run.joints[_topic_of(run, topic)]
    columns = _columns(run, whole)
    first = -np.inf if start_ns is None else (start_ns - run.start_ns) / NS_PER_S
    last = np.inf if end_ns is None else (end_ns - run.start_ns) / NS_PER_S
    track = whole.between(first, float(np.nextafter(last, np.inf)))
    finite = np.isfinite(track.value[:, columns]).all(axis=1)
    if not finite.any():
        raise BagError("%s: %s has no sample of six numbers%s" % (
            run.path, track.topic, " in the part that is asked for" if whole.facts.count else ""))
    time, position = track.time[finite], track.value[finite][:, columns]
    if len(time) < _FEWEST:
        raise BagError("%s: %s is too short to replay: %d samples in %.3f s; %d are needed" % (
            run.path, track.topic, len(time), time[-1] - time[0], _FEWEST))
    steps = np.diff(time)
    interval = float(np.median(steps[steps > 0.0])) if (steps > 0.0).any() else 0.0
    even = _without_bursts(time, interval)
    rises = np.append(np.diff(even) > 0.0, True)
    recording = Recording(run.path, track.topic, JOINTS, even[rises], position[rises])
    _check_continuous(recording, longest_gap)
    measured, good = _punctual(recording.time, interval)
    good[1:] &= measured[1:] > np.maximum.accumulate(measured)[:-1]
    return recording._replace(time=measured[good], position=recording.position[good])


def _topic_of(run: Run, topic: Optional[str]) -> str:
    if topic is not None:
        if topic not in run.joints:
            raise BagError("%s has no joint positions on %s; it has them on: %s" % (
                run.path, topic, ", ".join(sorted(run.joints)) or "no topic"))
        return topic
    positions = [name for name in run.joints if name.endswith("/joint_position")]
    candidates: List[str] = sorted(positions or run.joints)
    if not candidates:
        raise BagError("%s holds no joint positions: record the driver's topic joint_position (jaka_bag record "
                       "--state-log)" % run.path)
    if len(candidates) > 1:
        raise UsageError("%s has joint positions on several topics; choose one with --topic: %s" % (
            run.path, ", ".join(candidates)))
    return candidates[0]


def _columns(run: Run, track: LongTrack) -> List[int]:
    """Return the column of each joint of an arm; joints may come in any order, with a prefix."""
    found = [[column for column, name in enumerate(track.names) if name.endswith(joint)] for joint in JOINTS]
    if [len(columns) for columns in found] != [1] * len(JOINTS) or len(track.names) != len(JOINTS):
        raise BagError("%s: the joints on %s are %s; those of an arm are %s" % (
            run.path, track.topic, ", ".join(track.names), ", ".join(JOINTS)))
    return [columns[0] for columns in found]


def _without_bursts(time: Array, interval: float) -> Array:
    """Estimate from their times of arrival, s, when the samples were measured.

    A computer or network that holds them up lets them through in a burst, in which the arm would seem to leap. But the
    controller measures evenly: a sample is a period older than the next one, at least.
    """
    shortest = _EVEN_SHARE * interval * np.arange(len(time))
    even: Array = np.minimum.accumulate((time - shortest)[::-1])[::-1] + shortest
    return even if (time - even).max() <= _LONGEST_HOLD_S else time


def _punctual(time: Array, interval: float) -> Tuple[Array, Array]:
    """Estimate when the samples were measured, s (n,), and which of them to use, bool (n,): others came too late.

    Where the arm moves, a sample that is 10 ms late is as good as a position that is wrong by as much as it went
    meanwhile. The controller measures at whole periods, so samples that came near to one were measured there. Period
    and phase are found for some seconds at a time, as the clocks of controller and computer drift.
    """
    times, good = time.copy(), np.ones(len(time), bool)
    for first in range(0, len(time), _WINDOW):
        part = slice(max(0, min(first, len(time) - _WINDOW)), first + _WINDOW)
        since = time[part] - time[part][0]
        if len(since) < _WINDOW // 10 or interval <= 0.0:
            continue
        turns = since[:, None] / (interval * _PERIODS)
        means = np.exp(2j * np.pi * turns).mean(axis=0)
        best = int(np.abs(means).argmax())
        if np.abs(means[best]) < _CONCENTRATION:
            continue  # no period to be seen
        turn = turns[:, best] - float(np.angle(means[best])) / (2.0 * np.pi)
        late = turn - np.round(turn)
        good[part] = np.abs(late) <= _PUNCTUAL_TURN
        times[part] = np.where(good[part], time[part] - late * interval * _PERIODS[best], time[part])
    kept = np.flatnonzero(good)
    for before, after in zip(kept[:-1].tolist(), kept[1:].tolist()):
        if time[after] - time[before] > _LONGEST_HOLE_S:
            good[before:after] = True  # late samples are better than none
    return times, good


def _check_continuous(recording: Recording, longest_gap: float) -> None:
    """See that the samples can have been one motion of one arm."""
    times, steps = np.diff(recording.time), np.diff(recording.position, axis=0)
    away = np.abs(steps)
    largest = away.max(axis=1)
    gap = max(longest_gap, _GAP_INTERVALS * recording.interval)
    silent = np.flatnonzero((times > gap) & (largest > _STILL_RAD))
    jumps = np.flatnonzero((times <= gap) & (largest > _JUMP_RAD + JOINT_SPEED_CEILING * (times + _JUMP_S)))
    if len(jumps):
        at, joint = _worst(jumps, away)
        raise BagError("%s: %s of %s jumps from %.4f to %.4f rad at %.3f s, which no arm does: two recordings in one "
                       "log? Choose a part with --start and --end" % (
                           recording.path, recording.names[joint], recording.topic, recording.position[at, joint],
                           recording.position[at + 1, joint], recording.time[at + 1]))
    if len(silent):
        at, joint = _worst(silent, away)
        raise BagError("%s: for %.2f s from %.3f s on there is no sample of %s, and %s is %.4f rad farther then: how "
                       "it went there is not known. Choose a part with --start and --end (--max-gap bridges more)" % (
                           recording.path, times[at], recording.time[at], recording.topic, recording.names[joint],
                           largest[at]))


def _worst(where: Array, away: Array) -> Tuple[int, int]:
    first = int(where[0])
    return first, int(away[first].argmax())
