"""The condition of arm and links on /diagnostics, once a second."""
import logging
import platform
from typing import Callable, Optional, Tuple

import rospkg
import rospy
from diagnostic_msgs.msg import DiagnosticStatus
from diagnostic_updater import DiagnosticStatusWrapper, Updater

from jaka_ros_driver.audit.log import AuditLog
from jaka_ros_driver.client.arm_client import ArmClient
from jaka_ros_driver.client.core.links import LinkHealth
from jaka_ros_driver.client.core.procedures.power import missing_for_motion
from jaka_ros_driver.client.core.procedures.session import io_index_base
from jaka_ros_driver.errors import ConnectionLost
from jaka_ros_driver.protocol.ports import endpoint
from jaka_ros_driver.ros.controller_profile import knowledge
from jaka_ros_driver.ros.errands import ERRANDS
from jaka_ros_driver.ros.frame_table import FrameReader
from jaka_ros_driver.ros.model_check import ModelCheck
from jaka_ros_driver.ros.params import DriverConfig
from jaka_ros_driver.ros.topics.diagnostic_states import NO_STATES, state_of
from jaka_ros_driver.state import RobotState
from jaka_ros_driver.units import m_to_mm, s_to_ms

_LOG = logging.getLogger(__name__)

OK, WARN, ERROR, STALE = (DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR, DiagnosticStatus.STALE)
PERIOD_S = 1.0
"""Period, s, of the diagnostics: 1 Hz, as diagnostic_aggregator expects (it calls a status stale after 5 s)."""
_SLOW_FEED = 0.95
"""Share of the wanted rate below which the feed is reported as slow."""
_MAX_JITTER_S = 0.004
"""Jitter, s, above which a warning is published: half an interval of the feed at 125 Hz."""
_WARM, _HOT = 70.0, 80.0
"""Temperatures, deg C, above which a warning or an error is reported; no source gives limits, the controller protects
the arm.
"""

Task = Callable[[DiagnosticStatusWrapper], None]
StateTask = Callable[[DiagnosticStatusWrapper, RobotState], None]


class Diagnostics:
    """The reporter of the diagnostics, once a second. A failing check is reported and affects no other."""

    def __init__(self, arm: ArmClient, config: DriverConfig, frames: FrameReader, model_check: ModelCheck,
                 audit: Optional[AuditLog]) -> None:
        self._arm = arm
        self._frames = frames
        self._config = config
        self._model_check = model_check
        self._audit = audit
        self._audit_losses = 0
        self._late_cycles = 0
        self._damaged = 0
        self._connections = 0
        self._version = package_version()
        self._end: Callable[[], None] = lambda: None
        self._updater = Updater()
        self._guard_replacements = 0
        self._name_hardware(None)
        for name, task in self._tasks():
            self._updater.add(name, _guarded(name, task))

    def start(self) -> None:
        """Begin to report."""
        self._end = ERRANDS.every(PERIOD_S, self._report)

    def close(self) -> None:
        """Stop reporting."""
        self._end()

    def _report(self) -> None:
        self._name_hardware(self._arm.is_simulated)
        try:
            self._updater.force_update()
        except Exception:  # a message that cannot be sent must not end all later ones
            _LOG.exception("diagnostics")

    def _name_hardware(self, is_simulated: Optional[bool]) -> None:
        kind = "" if is_simulated is None else "simulated " if is_simulated else "controller "
        self._updater.setHardwareID(kind + endpoint(self._config.ip, self._config.command_port))

    def _tasks(self) -> Tuple[Tuple[str, Task], ...]:
        return (
            ("controller link", self._link), ("arm", self._arm_kind), ("guard", self._guard),
            ("custody", self._custody), ("status feed", self._feed), ("controller state", self._of_state(self._state)),
            ("emergency stop", self._of_state(_flag("emergency_stop", ERROR, "pressed", "released"))),
            ("protective stop", self._of_state(_flag("protective_stop", ERROR, "stands: clear_err", "none"))),
            ("soft limit", self._of_state(_flag("on_soft_limit", WARN, "a joint stands at its soft limit", "none"))),
            ("temperature", self._of_state(_temperature)), ("servo stream", self._servo),
            ("velocity jog", self._jog), ("kinematic model", self._of_state(self._model)),
            ("audit log", self._audit_log), ("versions", self._versions))

    def _of_state(self, task: StateTask) -> Task:
        """Return a task that needs a fresh state."""
        def run(status: DiagnosticStatusWrapper) -> None:
            try:
                state = self._arm.fresh_state()
            except ConnectionLost:
                status.summary(STALE, "no fresh state")
            else:
                task(status, state)
        return run

    def _link(self, status: DiagnosticStatusWrapper) -> None:
        health = self._arm.link_health
        reconnects = max(0, health.connections - 1)
        if not health.command_is_up or not health.status_is_up:
            status.summary(ERROR, "down: " + health.last_error)
        elif self._arm.feed_health.age > self._config.stale_after:
            status.summary(ERROR, NO_STATES)
        elif health.connections != self._connections and reconnects:
            status.summary(WARN, "connected anew")
        else:
            status.summary(OK, "up")
        self._connections = health.connections
        status.add("command port", "%d, %s" % (self._config.command_port, "up" if health.command_is_up else "down"))
        status.add("status port", "%d, %s" % (self._config.status_port, "up" if health.status_is_up else "down"))
        status.add("reconnects", str(reconnects))
        status.add("last error", health.last_error)
        status.add("damaged replies", str(health.damaged_replies))

    def _arm_kind(self, status: DiagnosticStatusWrapper) -> None:
        is_simulated = self._arm.is_simulated
        if is_simulated is None:
            status.summary(OK, "not known yet whether real or simulated")
        elif is_simulated:
            status.summary(WARN, "SIMULATED: no real arm moves")
        else:
            status.summary(OK, "real")

    def _guard(self, status: DiagnosticStatusWrapper) -> None:
        if self._arm.guard is None:
            status.summary(WARN, "switched off: nothing stops the arm when the driver dies")
            return
        health = self._arm.guard.health()
        if not health.is_alive:
            status.summary(ERROR, "does not answer: " + (health.last_trouble or "it is being started"))
        elif health.replacements != self._guard_replacements:
            status.summary(WARN, "was replaced: " + health.last_trouble)
        else:
            status.summary(OK, "watches")
        self._guard_replacements = health.replacements
        status.add("replacements", str(health.replacements))
        status.add("last trouble", health.last_trouble)

    def _custody(self, status: DiagnosticStatusWrapper) -> None:
        foreign = self._arm.foreign_motion
        owner = self._arm.motion_owner
        status.summary(WARN if foreign else OK, foreign or "nobody moves the arm" if owner is None or foreign
                       else owner.value)

    def _feed(self, status: DiagnosticStatusWrapper) -> None:
        health = self._arm.feed_health
        damaged_now = health.damaged - self._damaged
        self._damaged = health.damaged
        if health.age > self._config.stale_after:
            status.summary(STALE, "no fresh state" if health.frames else "no state yet")
        elif damaged_now:
            status.summary(WARN, "%d damaged frames in the last second" % damaged_now)
        elif health.rate < _SLOW_FEED * self._config.publish_rate:
            status.summary(WARN, "slow: %.1f Hz" % health.rate)
        elif health.jitter > _MAX_JITTER_S:
            status.summary(WARN, "jitter %.1f ms" % s_to_ms(health.jitter))
        else:
            status.summary(OK, "%.1f Hz" % health.rate)
        status.add("rate, Hz", "%.2f" % health.rate)
        status.add("age, ms", "%.1f" % s_to_ms(health.age))
        status.add("jitter p99, ms", "%.2f" % s_to_ms(health.jitter))
        state = self._arm.state
        if state is not None:
            status.add("joint velocity", "filtered difference" if state.joint_velocity is None else "the controller's")
        status.add("frames", str(health.frames))
        status.add("damaged frames", str(health.damaged))
        status.add("last damage", health.last_damage)

    def _state(self, status: DiagnosticStatusWrapper, state: RobotState) -> None:
        missing, motion = missing_for_motion(state), state.shown_motion_state(self._arm.is_stream_moving)
        if state.has_fault:
            status.summary(ERROR, "event 0x%X %s" % (state.error_code, state.error_message))
        elif missing:
            status.summary(WARN, "cannot move; to do: " + ", ".join(missing))
        else:
            status.summary(OK, motion.name.lower().replace("_", " "))
        status.add("powered", str(state.is_powered))
        status.add("enabled", str(state.is_enabled))
        status.add("motion state", motion.name.lower())
        status.add("servo mode", str(self._arm.is_servo_active))
        owner = self._arm.motion_owner
        status.add("motion owner", owner.value if owner is not None else "nobody")
        status.add("hand guiding", str(state.is_hand_guided))
        status.add("tool", str(state.tool_id))
        status.add("user frame", str(state.user_frame_id))
        status.add("speed override", str(state.rapid_rate))
        payload, level = self._frames.payload, self._frames.collision_level
        status.add("payload", "unknown" if payload is None else "%.6g kg at %.6g, %.6g, %.6g m" % (
            payload.mass, *payload.centroid))
        status.add("collision level", "unknown" if level is None else str(level))
        status.add("event", "0x%X %s" % (state.error_code, state.error_message))

    def _servo(self, status: DiagnosticStatusWrapper) -> None:
        late = self._arm.late_servo_cycles
        late_now, self._late_cycles = max(0, late - self._late_cycles), late
        if not self._arm.is_servo_active:
            status.summary(OK, "not in servo mode")
        elif late_now:
            status.summary(WARN, "%d cycles too late in the last second" % late_now)
        else:
            status.summary(OK, "on time")
        status.add("late cycles of this stream", str(late))

    def _jog(self, status: DiagnosticStatusWrapper) -> None:
        jog = self._arm.velocity_jog
        status.summary(OK, "held by " + jog.held_by if jog.held_by else "not held")
        status.add("last end", jog.last_end)
        status.add("stands at", jog.obstacle)

    def _model(self, status: DiagnosticStatusWrapper, state: RobotState) -> None:
        deviation = self._model_check.check(state)
        if deviation is None:
            status.summary(OK, "not compared now: in motion, or the controller does not tell its frames")
        elif deviation.is_wrong:
            status.summary(ERROR, "the controller's pose differs from model %s: is ~model right?"
                           % self._arm.model.name)
        else:
            status.summary(OK, "%s agrees with the controller" % self._arm.model.name)
        if deviation is not None:
            status.add("distance, mm", "%.4f" % m_to_mm(deviation.distance))
            status.add("angle, mrad", "%.4f" % (1000.0 * deviation.angle))

    def _audit_log(self, status: DiagnosticStatusWrapper) -> None:
        if self._audit is None:
            status.summary(WARN, "switched off: nobody records who does what")
            return
        health = self._audit.health()
        lost_now, self._audit_losses = health.lost - self._audit_losses, health.lost
        if health.trouble:
            status.summary(WARN, "cannot be written: " + health.trouble)
        elif lost_now:
            status.summary(WARN, "%d lines were lost" % lost_now)
        else:
            status.summary(OK, "written")
        status.add("folder", self._audit.path)
        status.add("last line", str(health.link.number))
        status.add("its sha256", health.link.sha256)
        status.add("waiting lines", str(health.waiting))
        status.add("lost lines", str(health.lost))

    def _versions(self, status: DiagnosticStatusWrapper) -> None:
        health = self._arm.link_health
        status.summary(OK, "driver %s, controller %s" % (self._version, health.version or "unknown"))
        status.add("driver", self._version)
        status.add("controller", health.version or "unknown")
        status.add("model", self._arm.model.name)
        status.add("interface", self._config.interface)
        status.add("status period, ms", "unknown" if health.feed_period is None else "%g" % s_to_ms(health.feed_period))
        status.add("python", platform.python_version())
        self._add_knowledge(status, health)

    def _add_knowledge(self, status: DiagnosticStatusWrapper, health: LinkHealth) -> None:
        """Report what the driver relies on of this controller, and what of it is known."""
        config, profile = self._config, self._config.controller_profile
        settings = config.client_settings()
        for point, words in knowledge(profile, io_index_base(settings, health.version), config.is_io_base_set,
                                      settings.link_loss_stop, health.feed_period):
            status.add(point, words)
        if profile is not None:
            same = "" if profile.version == health.version else ", which is not this controller's"
            status.add("controller profile", "%s, of version %s%s" % (profile.path, profile.version, same))


def _flag(field: str, level: int, bad: str, good: str) -> StateTask:
    return lambda status, state: status.summary(*((level, bad) if getattr(state, field) else (OK, good)))


def _temperature(status: DiagnosticStatusWrapper, state: RobotState) -> None:
    joints = state.joint_temperature or ()
    cabinet = () if state.cabinet_temperature is None else (state.cabinet_temperature,)
    if not joints and not cabinet:
        status.summary(OK, "not reported by the controller")
        return
    hottest = max(joints + cabinet)
    status.summary(ERROR if hottest > _HOT else WARN if hottest > _WARM else OK, "hottest %.1f deg C" % hottest)
    for value in cabinet:
        status.add("cabinet, deg C", "%.1f" % value)
    for n, value in enumerate(joints):
        status.add("joint %d, deg C" % (n + 1), "%.1f" % value)


def _guarded(name: str, task: Task) -> Callable[[DiagnosticStatusWrapper], DiagnosticStatusWrapper]:
    def run(status: DiagnosticStatusWrapper) -> DiagnosticStatusWrapper:
        try:
            task(status)
        except Exception as error:  # a check that fails must not affect the others
            _LOG.exception("diagnostic task %s", name)
            status.summary(ERROR, "this check failed: %r" % error)
        shown = state_of(name, (OK, WARN, ERROR, STALE).index(status.level), status.message)
        if shown is not None:
            status.add("meaning", shown.meaning)
            status.add("remedy", shown.remedy)
        return status
    return run


def package_version() -> str:
    """Return the version of this package, as ROS knows it; "unknown" where it does not."""
    try:
        return str(rospkg.RosPack().get_manifest("jaka_ros_driver").version)
    except (rospkg.ResourceNotFound, rospkg.InvalidManifest) as error:
        rospy.logdebug("%s", error)
        return "unknown"
