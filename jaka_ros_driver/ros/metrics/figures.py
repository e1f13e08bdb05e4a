"""The driver's figures for Prometheus: read when they are asked for, from what the client knows anyway.

Only what would be over before anybody asks is counted as it happens: alarms, motions and stops, by an addition each.
"""
import platform
from typing import Dict, Iterable, Iterator, List, Optional, Tuple

from prometheus_client import CollectorRegistry, Histogram, ProcessCollector
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, InfoMetricFamily, Metric
from prometheus_client.exposition import CONTENT_TYPE_LATEST, generate_latest
from prometheus_client.registry import Collector

from jaka_ros_driver.audit.log import AuditLog
from jaka_ros_driver.client.arm_client import ArmClient
from jaka_ros_driver.client.core.actions import NotifyGuard
from jaka_ros_driver.client.core.motion import MotionOwner
from jaka_ros_driver.errors import ConnectionLost
from jaka_ros_driver.ros.metrics.page_server import Page
from jaka_ros_driver.ros.params import DriverConfig
from jaka_ros_driver.state import RobotState

STOP_BUCKETS_S = (0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0)
"""Upper bounds, s, of the classes of stop latency."""
NOBODY = "nobody"
_OWNERS: Dict[str, str] = {owner.value: owner.name.lower() for owner in MotionOwner}
_ALARMS: Tuple[Tuple[str, str], ...] = (
    ("fault", "has_fault"), ("emergency_stop", "emergency_stop"), ("protective_stop", "protective_stop"),
    ("soft_limit", "on_soft_limit"))


class Figures(Collector):
    """The figures of one driver."""

    def __init__(self, arm: ArmClient, config: DriverConfig, audit: Optional[AuditLog], version: str) -> None:
        """Set up; ``start`` begins to count.

        version: This package's.
        """
        self._arm, self._config, self._audit, self._version = arm, config, audit, version
        self._alarms = {kind: 0 for kind, _ in _ALARMS}
        self._shown = dict.fromkeys(self._alarms, False)
        self._motions = dict.fromkeys(_OWNERS.values(), 0)
        self._failed_stops = 0
        self._latency = Histogram("jaka_stop_latency_seconds", "Time from the call of a stop to its answer: accepted "
                                  "by the controller, of some motions at rest.", buckets=STOP_BUCKETS_S, registry=None)
        self._registry = CollectorRegistry()
        self._registry.register(self)
        ProcessCollector(registry=self._registry)

    def start(self) -> None:
        """Begin to count what happens."""
        self._arm.add_listener(self._seen)
        self._arm.add_custody_listener(self._moved)
        self._arm.stop_timer.add_listener(self._stopped)

    def page(self) -> Page:
        """Return the page in Prometheus's text format."""
        return Page(CONTENT_TYPE_LATEST, generate_latest(self._registry))

    # ---- what is counted, in the client's thread and in those of callers ----

    def _seen(self, state: RobotState, is_new: bool) -> None:
        for kind, field in _ALARMS:
            is_set = bool(getattr(state, field))
            if is_set is not self._shown[kind] and is_new:
                self._shown[kind] = is_set
                self._alarms[kind] += is_set

    def _moved(self, tell: NotifyGuard) -> None:
        kind = _OWNERS.get(tell.name)
        if tell.is_moving and kind is not None:
            self._motions[kind] += 1

    def _stopped(self, latency: float, is_accepted: bool) -> None:
        if is_accepted:
            self._latency.observe(latency)
        else:
            self._failed_stops += 1

    # ---- what is read, in the server's thread ----

    def describe(self) -> List[Metric]:
        """Return nothing: what is served is known when it is asked for."""
        return []

    def collect(self) -> Iterator[Metric]:
        """Return all figures; those of a state only while that is fresh."""
        link, feed, owner = self._arm.link_health, self._arm.feed_health, self._arm.motion_owner
        yield InfoMetricFamily("jaka_driver", "What runs.", {
            "version": self._version, "controller": link.version, "model": self._arm.model.name,
            "interface": self._config.interface, "python": platform.python_version()})
        yield _by("jaka_link_up", "1 while the port is connected, and the command port answers.", "port",
                  (("command", link.command_is_up), ("status", link.status_is_up)))
        yield _counted("jaka_link_losses", "Connections that ended after they were up.", "port",
                       (("command", link.command_losses), ("status", link.status_losses)))
        yield _count("jaka_damaged_replies", "Replies of the controller that could not be read.", link.damaged_replies)
        yield _one("jaka_feed_rate_hertz", "Status frames a second over the last two seconds.", feed.rate)
        yield _one("jaka_feed_jitter_seconds", "99th percentile of the deviation of the interval of status frames from "
                   "its median.", feed.jitter)
        yield _count("jaka_feed_frames", "Status frames that could be used.", feed.frames)
        yield _count("jaka_feed_damaged_frames", "Status frames that were refused.", feed.damaged)
        yield _one("jaka_state_age_seconds", "Age of the newest usable status frame; +Inf before the first.", feed.age)
        yield from self._latency.collect()
        yield _count("jaka_stop_failures", "Calls of a stop that the controller did not accept in time.",
                     self._failed_stops)
        yield _counted("jaka_alarms", "Alarms that began.", "kind", self._alarms.items())
        yield _counted("jaka_motions", "Motions that this driver began.", "kind", self._motions.items())
        held_by = NOBODY if owner is None else owner.name.lower()
        yield _by("jaka_motion_owner", "1 for what holds the arm's motion now.", "owner",
                  ((name, name == held_by) for name in (NOBODY, *_OWNERS.values())))
        yield _one("jaka_foreign_motion", "1 while the arm moves and not by this driver.",
                   bool(self._arm.foreign_motion))
        yield _one("jaka_servo_late_cycles", "Cycles of the present servo stream whose targets came too late.",
                   self._arm.late_servo_cycles)
        yield from self._of_guard()
        yield from self._of_audit_log()
        try:
            state = self._arm.fresh_state()
        except ConnectionLost:
            yield _one("jaka_state_fresh", "1 while the figures of the arm's state can be shown.", False)
        else:
            yield _one("jaka_state_fresh", "1 while the figures of the arm's state can be shown.", True)
            yield from _of_state(state)

    def _of_guard(self) -> Iterator[Metric]:
        if self._arm.guard is not None:
            health = self._arm.guard.health()
            yield _one("jaka_guard_up", "1 while the guard process runs and answers.", health.is_alive)
            yield _count("jaka_guard_replacements", "Guard processes that had to be replaced.", health.replacements)

    def _of_audit_log(self) -> Iterator[Metric]:
        if self._audit is not None:
            health = self._audit.health()
            yield _one("jaka_audit_up", "1 while the audit log can be written.", not health.trouble)
            yield _one("jaka_audit_lag_seconds", "Age of the oldest line that waits to be written.", health.lag)
            yield _one("jaka_audit_waiting_lines", "Lines that are not surely on the disk yet.", health.waiting)
            yield _count("jaka_audit_written_lines", "Lines that were written.", health.written)
            yield _count("jaka_audit_lost_lines", "Lines that could not be kept.", health.lost)


def _of_state(state: RobotState) -> Iterator[Metric]:
    yield _one("jaka_powered", "1 while the drives have power.", state.is_powered)
    yield _one("jaka_enabled", "1 while the brakes are open and torque is on.", state.is_enabled)
    yield _by("jaka_alarm", "1 while the alarm lasts.", "kind",
              ((kind, bool(getattr(state, field))) for kind, field in _ALARMS))
    if state.rapid_rate is not None:
        yield _one("jaka_speed_override_ratio", "Speed override, 0 to 1.", state.rapid_rate)
    parts = [("joint_%d" % n, value) for n, value in enumerate(state.joint_temperature or (), 1)]
    if state.cabinet_temperature is not None:
        parts.append(("cabinet", state.cabinet_temperature))
    if parts:
        yield _by("jaka_temperature_celsius", "Temperatures that the controller reports.", "part", parts)


def _one(name: str, text: str, value: float) -> Metric:
    return GaugeMetricFamily(name, text, float(value))


def _count(name: str, text: str, value: float) -> Metric:
    return CounterMetricFamily(name, text, value)


def _by(name: str, text: str, label: str, values: Iterable[Tuple[str, float]]) -> Metric:
    family = GaugeMetricFamily(name, text, labels=[label])
    for value, figure in values:
        family.add_metric([value], float(figure))
    return family


def _counted(name: str, text: str, label: str, values: Iterable[Tuple[str, float]]) -> Metric:
    family = CounterMetricFamily(name, text, labels=[label])
    for value, figure in values:
        family.add_metric([value], figure)
    return family
