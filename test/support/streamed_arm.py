"""The simulated arm behind streams of frames: trajectories and velocity jogs, and what each cycle did with the arm."""
import numpy as np
from simulated_arm import START_TOLERANCE, SimulatedArm

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

    def _moving(self):
        """Return the joints' velocities, rad/s (n, 6), from the first cycle that moves the arm to the last."""
        velocities = np.diff(np.array(self.places), axis=0) / CYCLE_TIME_S
        moved = np.flatnonzero(np.abs(velocities).max(axis=1) > 0.0)
        return velocities[moved.min():moved.max() + 1]
