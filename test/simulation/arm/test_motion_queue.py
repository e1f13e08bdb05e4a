"""Random sequences of everything that can be asked of the arm: no jump, no limit passed, always back to rest."""
import math

from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule
from plant_watch import PlantWatch, shift

from jaka_ros_driver.commands import JogFrame
from jaka_ros_driver.simulation.arm.events import TargetRejected
from jaka_ros_driver.simulation.arm.plant import HOME, JogMode

SPEEDS = st.sampled_from([0.02, 0.1, 0.4, 1.5])
ACCELERATIONS = st.sampled_from([None, 0.3, 2.0, 10.0])
SHORT = st.floats(-0.15, 0.15)
TURN = st.floats(-0.6, 0.6)


class AnySequence(RuleBasedStateMachine):
    jerk_limited = True

    def __init__(self):
        super().__init__()
        self.watch = PlantWatch(jerk_limited=self.jerk_limited)
        self.plant = self.watch.plant

    def _try(self, action, *arguments, **options):
        before = self.plant.queue.length, self.plant.queue.is_jogging
        try:
            action(*arguments, **options)
        except TargetRejected:
            assert (self.plant.queue.length, self.plant.queue.is_jogging) == before

    @rule(way=st.tuples(*[TURN] * 6), speed=SPEEDS, acceleration=ACCELERATIONS)
    def joint_move(self, way, speed, acceleration):
        self._try(self.plant.add_joint_move, way, 2.0 * speed, acceleration, relative=True, line_id=2)

    @rule(x=SHORT, y=SHORT, z=SHORT, turn=TURN, speed=SPEEDS, acceleration=ACCELERATIONS,
          tolerance=st.sampled_from([0.0, 0.001, 0.02]))
    def linear_move(self, x, y, z, turn, speed, acceleration, tolerance):
        self._try(self.plant.add_linear_move, shift(x, y, z, (0.0, turn, turn)), speed, acceleration, relative=True,
                  tolerance=tolerance, line_id=3)

    @rule(x=SHORT, y=SHORT, z=SHORT, turn=TURN, speed=SPEEDS, mode=st.integers(0, 3))
    def arc_move(self, x, y, z, turn, speed, mode):
        self._try(self.plant.add_arc_move, shift(x, y, 0.0), shift(y, 0.0, z, (turn, 0.0, turn)), speed, relative=True,
                  circle_mode=mode, line_id=4)

    @rule(mode=st.sampled_from(JogMode), frame=st.sampled_from(JogFrame), axis=st.integers(0, 5),
          velocity=st.sampled_from([-0.5, -0.05, 0.05, 0.5]), position=st.floats(-0.3, 0.3))
    def jog(self, mode, frame, axis, velocity, position):
        self._try(self.plant.jog, mode, frame, axis, velocity, position)

    @rule(frame=st.sampled_from(JogFrame), axis=st.integers(0, 5))
    def jog_stop(self, frame, axis):
        self.plant.queue.end_jog(frame, axis)

    @rule()
    def stop(self):
        self.plant.stop()
        assert self.plant.queue.length == 0

    @rule()
    def pause(self):
        self.plant.queue.pause()

    @rule()
    def resume(self):
        self.plant.queue.resume()

    @rule()
    def halt_protective(self):
        self.plant.halt_protective()

    @rule()
    def halt_emergency(self):
        self.plant.halt_emergency()

    @rule(rate=st.sampled_from([0.0, 0.1, 0.7, 1.0]))
    def rapid_rate(self, rate):
        self.plant.set_rapid_rate(rate)

    @rule()
    def start_hand_guiding(self):
        self._try(self.plant.start_hand_guiding)

    @precondition(lambda self: self.plant.is_hand_guided)
    @rule(joint=st.integers(0, 5), velocity=st.floats(-2.0, 2.0))
    def push(self, joint, velocity):
        self.plant.push_joint(joint, velocity)

    @rule()
    def stop_hand_guiding(self):
        self.plant.stop_hand_guiding()

    @rule(cycles=st.sampled_from([1, 3, 20, 80]))
    def let_time_pass(self, cycles):
        self.watch.step(cycles)

    @invariant()
    def a_pending_motion_is_never_in_position(self):
        if self.plant.queue.length or self.plant.queue.is_jogging:
            assert not self.plant.is_in_position

    def teardown(self):
        self.plant.stop_hand_guiding()
        self.plant.stop()
        self.watch.run(3.0)
        assert not self.plant.is_moving
        self.plant.set_rapid_rate(1.0)
        self.plant.add_joint_move(HOME, 3.0, 12.0)
        self.watch.run()
        assert all(math.isclose(a, b, abs_tol=1e-6) for a, b in zip(self.plant.joint_position, HOME))


class AnySequenceOfTrapezoids(AnySequence):
    jerk_limited = False


FEW = settings(max_examples=40, stateful_step_count=25,
               suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large])
TestAnySequence = AnySequence.TestCase
TestAnySequence.settings = FEW
TestAnySequenceOfTrapezoids = AnySequenceOfTrapezoids.TestCase
TestAnySequenceOfTrapezoids.settings = FEW


def test_a_stop_on_the_way_into_a_singular_place_is_as_gentle_as_the_way_itself():
    watch = PlantWatch(jerk_limited=False)
    watch.plant.add_arc_move(shift(0.0, 0.1, 0.0), shift(0.1, 0.0, 0.05, (-0.23, 0.0, -0.23)), 0.4, relative=True,
                             circle_mode=1, line_id=4)
    watch.step(170)
    watch.plant.stop()
    watch.run(3.0)
    assert watch.hardest <= 1.02
