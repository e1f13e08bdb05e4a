"""The motion of a velocity jog: streamed as joint frames while the dead-man is held; braked when it is not."""
import logging
from typing import NamedTuple, Optional

from jaka_ros_driver.client.core.custody import Custody
from jaka_ros_driver.client.core.motion import MotionOwner
from jaka_ros_driver.client.core.streaming import MAX_JOINT_DEVIATION, OnMode, Streaming, commanded_joints
from jaka_ros_driver.client.core.velocity_jog.dead_man import DeadMan
from jaka_ros_driver.client.core.velocity_jog.ramp import JogRamp, JogSpeeds
from jaka_ros_driver.commands import JogStop, ServoJoint
from jaka_ros_driver.errors import JakaError, MotionInterrupted, StopCause
from jaka_ros_driver.kinematics.arm_models import ArmModel
from jaka_ros_driver.state import RobotState, Vector

_IDLE_S = 1.0
"""Time, s, of wanted rest after which servo mode is left, so that others can have the arm."""


class JogReport(NamedTuple):
    """The velocity jog as it is to be shown.

    Attributes:
        held_by: The publisher that holds the dead-man; "" for nobody.
        last_end: The reason for which it was released last, in words.
        obstacle: The reason why the tool stands, though it is asked to move; "" where it does not.
    """

    held_by: str
    last_end: str
    obstacle: str


class VelocityJog(Streaming):
    """A motion that follows the held dead-man, and brakes when it is released. It never begins again by itself.

    Attributes:
        obstacle: Why the tool stands, though it is asked to move; "" where it does not.
    """

    owner = MotionOwner.VELOCITY_JOG
    has_reserve = True

    def __init__(self, custody: Custody, model: ArmModel, dead_man: DeadMan, state: RobotState,
                 on_mode: OnMode) -> None:
        """Set up the motion.

        Args:
            custody: Of this motion.
            model: The arm model with the limits.
            dead_man: Is held now.
            state: Before the motion.
            on_mode: Called with whether servo mode is on and, when it has ended, why.
        """
        super().__init__(custody, state, on_mode)
        self._model = model
        self._dead_man = dead_man
        self._grip = dead_man.grip
        self._ramp: Optional[JogRamp] = None
        self._idle_since: Optional[float] = None
        self.obstacle = ""

    # ---- life ----

    def halt(self) -> Optional[JogStop]:
        self._dead_man.release("the jog was stopped")
        return super().halt()

    def ended(self, outcome: Optional[MotionInterrupted]) -> None:
        reason = self._leave_reason or "" if outcome is None else str(outcome)
        if outcome is not None:
            self._dead_man.release(reason)
        self._on_mode(False, reason)

    def _entered(self, now: float) -> None:
        settings = self._custody.settings
        begin = commanded_joints(self._state)
        self._is_guarded(begin)
        self._ramp = JogRamp(begin, self._model, JogSpeeds(
            settings.jog_max_joint_speed, settings.jog_max_linear_speed, settings.jog_max_angular_speed))

    def _not_entered(self, error: JakaError) -> None:
        self._dead_man.release(str(error))
        self._custody.actions.log(logging.WARNING, "velocity jog: %s" % error)

    def _brakes(self, trouble: str) -> None:
        super()._brakes(trouble)
        self._dead_man.release(trouble)

    def _frame(self, now: float) -> ServoJoint:
        assert self._ramp is not None
        wish = self._dead_man.wish(now + self._lead)  # what counts when the frame is due: silence costs no reserve
        if self._leave_reason is not None or wish is None or self._dead_man.grip != self._grip:
            self._release()
            return ServoJoint(self._ramp.step(None))
        if not (wish.is_zero and self._ramp.is_still):
            self._idle_since = None
        elif self._idle_since is None:
            self._idle_since = now
        elif now - self._idle_since >= _IDLE_S:
            self._leave("the jog has rested for %g s" % _IDLE_S)
        joints = self._ramp.step(wish, self._scale)
        if self._ramp.obstacle != self.obstacle:
            self.obstacle = self._ramp.obstacle
            if self.obstacle:
                self._custody.actions.log(logging.WARNING, "velocity jog: the tool stands: %s" % self.obstacle)
        return ServoJoint(joints)

    def _sent_point(self) -> Vector:
        assert self._ramp is not None
        return self._ramp.position

    def _is_over(self) -> bool:
        return self._leave_reason is not None and self._ramp is not None and self._ramp.is_still

    def _contradiction(self, state: RobotState) -> Optional[MotionInterrupted]:
        excess = self._trace.excess(state.joint_position)
        if excess <= MAX_JOINT_DEVIATION:
            return None
        return MotionInterrupted(StopCause.FAULT, "the arm is %.3f rad from where it was sent" % excess)

    # ---- inside ----

    @property
    def _scale(self) -> float:
        """The controller's speed override."""
        rate = self._state.rapid_rate
        return 1.0 if rate is None else min(max(rate, 0.0), 1.0)

    def _leave(self, reason: str) -> None:
        self._leave_reason = reason
        self.is_leaving = True

    def _release(self) -> None:
        self.obstacle = ""
        if self._leave_reason is None:
            self._leave(self._dead_man.last_end)
            self._custody.actions.log(logging.INFO, "velocity jog: %s; the arm brakes" % self._leave_reason)
