"""The simulated arm behind streams of frames: trajectories and velocity jogs, and what each cycle did with the arm."""
import contextlib
import types
from concurrent.futures import Future

import numpy as np
from simulated_arm import START_TOLERANCE, SimulatedArm

from jaka_ros_driver.client import arm_client
from jaka_ros_driver.client.core.velocity_jog.dead_man import JogMessage
from jaka_ros_driver.errors import InvalidCommand
from jaka_ros_driver.simulation.arm.plant import CYCLE_TIME_S
from jaka_ros_driver.trajectory.build import BuildOptions, build_path
from jaka_ros_driver.trajectory.points import JointTrajectory, TrajectoryTolerances

REST = (0.0,) * 6
TOLERANCES = TrajectoryTolerances((None,) * 6, (0.001,) * 6, 0.5)
_JOG_PERIOD_S = 0.02
_MESSAGES_OF_REST = 6


class StreamedArm(SimulatedArm):
    """An arm that is streamed to."""

    def begin_trajectory(self, *points):
        """Begin a trajectory as the shell does, where the arm rests or on the running one; return its call."""
        start = self.begin("trajectory_start", 0.016, 0).result
        path = build_path(start.begin, JointTrajectory(points), 0.0, self._model, BuildOptions(START_TOLERANCE))
        return self.begin("follow", path, start, TOLERANCES, 0)

    def jog(self, wish, seconds):
        """Hold a velocity jog: messages of rest, then this wish every 20 ms; return why it was refused, "" if it was
        not."""
        for number in range(round(seconds / _JOG_PERIOD_S)):
            said = wish if number >= _MESSAGES_OF_REST else wish._replace(velocity=REST)
            message = JogMessage("pad", int(1e9 * self.now), 0.0, self.now, said)
            try:
                self.act(lambda now, message=message: self.core.jog_velocity(message, now))
            except InvalidCommand as error:
                return str(error)
            self.run(_JOG_PERIOD_S)
        return ""

    def halts(self):
        """Return the number of cycles in which the arm stood, between two that moved it."""
        return int((np.abs(self._moving()).max(axis=1) == 0.0).sum())

    def accelerations(self):
        """Return the acceleration of the fastest joint from each cycle to the next, rad/s2 (n,)."""
        return np.abs(np.diff(np.vstack([REST, self._moving(), REST]), axis=0)).max(axis=1) / CYCLE_TIME_S

    def hardest(self):
        """Return the highest acceleration of a joint, rad/s2."""
        return float(self.accelerations().max())

    def moved_frames(self):
        """Return when each frame was sent that leads elsewhere than the one before it, s (n,)."""
        return [at for (at, place), (_, before) in zip(self.frames[1:], self.frames) if place != before]

    def _answer(self, action):
        if not isinstance(action.call, Future):
            super()._answer(action)
        elif action.error is None:
            action.call.set_result(action.result)
        else:
            action.call.set_exception(action.error)

    def _moving(self):
        """Return the joints' velocities, rad/s (n, 6), from the first cycle that moves the arm to the last."""
        velocities = np.diff(np.array(self.places), axis=0) / CYCLE_TIME_S
        moved = np.flatnonzero(np.abs(velocities).max(axis=1) > 0.0)
        return velocities[moved.min():moved.max() + 1]


class StreamedClient(arm_client.ArmClient):
    """The calls of an ``ArmClient`` for an arm in virtual time, without its thread and its sockets."""

    def __init__(self, arm, model):
        """Take the arm's driver over; ``streamed_client`` gives it the arm's time."""
        super().__init__(arm.core.settings, model)
        self._arm, self._core = arm, arm.core

    def _perform(self):
        self._arm.act(lambda now: None)

    def _call(self, enter):
        call = self._begin(enter)
        self._arm.until(call.done)
        return call.result()


@contextlib.contextmanager
def streamed_client(arm, model, monkeypatch):
    """Yield the client of an arm, which reads the arm's clock; close it in the end."""
    monkeypatch.setattr(arm_client, "time", types.SimpleNamespace(monotonic=lambda: arm.now))
    client = StreamedClient(arm, model)
    try:
        yield client
    finally:
        client.close()
