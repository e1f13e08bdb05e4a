"""~io_states: when it is published, driven by states and times; and on the running node, from terminal to message."""
import contextlib
import dataclasses
import itertools
import time
from types import SimpleNamespace

import pytest
import rospy
from driver_bench import SimulatorProcess, collecting
from waiting import eventually

from jaka_msgs.msg import IOStates
from jaka_ros_driver.ros.topics import io_states
from jaka_ros_driver.ros.topics.stamps import SampleStamps, StampClock
from jaka_ros_driver.state import BusTerminals, FieldBus, IoBank, IoState, RobotState

PERIOD_S = 0.008
STATE = RobotState((0.0,) * 6, True, True, True, False, False)
QUIET = IoState({IoBank.CABINET: (0, 0), IoBank.TOOL: (0,)}, {IoBank.CABINET: (0, 0)}, {IoBank.CABINET: (0.5, 1.5)},
                {IoBank.CABINET: (2.5,)}, (0, 0), {FieldBus.MODBUS_SLAVE: BusTerminals((0,), (0,), (7,), (8,))})
DIGITAL = [
    dataclasses.replace(QUIET, digital_inputs={IoBank.CABINET: (0, 1), IoBank.TOOL: (0,)}),
    dataclasses.replace(QUIET, digital_inputs={IoBank.CABINET: (0, 0), IoBank.TOOL: (1,)}),
    dataclasses.replace(QUIET, digital_outputs={IoBank.CABINET: (1, 0)}),
    dataclasses.replace(QUIET, relays=(0, 1)),
    dataclasses.replace(QUIET, field_buses={FieldBus.MODBUS_SLAVE: BusTerminals((0,), (1,), (7,), (8,))}),
    dataclasses.replace(QUIET, digital_inputs={IoBank.CABINET: (0, 0)})]


class Bench:
    """The publisher on an arm whose states the test gives."""

    def __init__(self, monkeypatch):
        self.messages, self.subscribers, self.now = [], 1, 100.0
        topic = SimpleNamespace(publish=self.messages.append, get_num_connections=lambda: self.subscribers)
        monkeypatch.setattr(io_states, "direct_publisher", lambda *_, **options: self.offered.update(options) or topic)
        self.offered = {}
        arm = SimpleNamespace(add_listener=lambda listener: setattr(self, "arrived", listener))
        stamps = SampleStamps(StampClock(lambda: int(self.now * 1e9), lambda: self.now))
        io_states.IoPublisher(arm, stamps).start()

    def feed(self, io, count=1, is_new=True):
        """Pass so many frames, each with the next of ``io``; return how many messages came of them."""
        before = len(self.messages)
        for _, one in zip(range(count), itertools.cycle(io if isinstance(io, list) else [io])):
            self.now += PERIOD_S
            self.arrived(dataclasses.replace(STATE, received_at=self.now, io=one), is_new)
        return len(self.messages) - before


@pytest.fixture
def bench(monkeypatch):
    return Bench(monkeypatch)


def test_it_is_latched_and_tells_each_terminal_in_its_place(bench):
    assert bench.feed(QUIET) == 1 and bench.offered["latch"]
    message = bench.messages[0]
    assert message.header.stamp.to_sec() == pytest.approx(bench.now)
    assert (message.cabinet.digital_inputs, message.cabinet.analog_inputs) == ([False, False], [0.5, 1.5])
    assert (message.cabinet.analog_outputs, message.tool.digital_inputs) == ([2.5], [False])
    assert message.relays == [False, False] and message.modbus_slave.analog_inputs == [7]
    assert not any((message.extension.digital_inputs, message.profinet_slave.digital_inputs,
                    message.tool.analog_inputs))


@pytest.mark.parametrize("changed", DIGITAL)
@pytest.mark.parametrize("subscribers", [0, 1])
def test_a_digital_change_is_told_by_the_frame_that_shows_it(bench, changed, subscribers):
    bench.feed(QUIET, 2)
    bench.subscribers = subscribers
    assert bench.feed(changed) == 1 and bench.feed(changed) == 0
    assert bench.feed([QUIET, changed], 10) == 10


def test_without_a_change_it_comes_once_a_second(bench):
    bench.feed(QUIET)
    assert bench.feed(QUIET, 1250) in (9, 10)


def test_terminals_of_which_none_has_changed_are_not_compared(bench, monkeypatch):
    bench.feed(QUIET)
    monkeypatch.setattr(io_states, "_digital", None)
    assert bench.feed(QUIET, 100) == 0


@pytest.mark.parametrize("subscribers, most", [(1, 12), (0, 1)])
def test_analog_noise_is_told_ten_times_a_second_at_most_and_to_subscribers_only(bench, subscribers, most):
    bench.feed(QUIET)
    bench.subscribers = subscribers
    noise = [dataclasses.replace(QUIET, analog_inputs={IoBank.CABINET: (0.5 + 0.001 * n, 1.5)}) for n in range(3)]
    assert 0.6 * most < bench.feed(noise, 126) <= most


def test_old_news_and_a_feed_without_terminals_are_not_told(bench):
    assert bench.feed(QUIET, 3, is_new=False) == 0
    assert bench.feed(IoState(), 300) == 0
    assert bench.feed(DIGITAL[0]) == 1


# ---- on the running node ----

@pytest.fixture(scope="module")
def simulator():
    """Start a controller of the generation whose feed has relays and field buses."""
    with contextlib.closing(SimulatorProcess("--start", "enabled", "--firmware", "1.7")) as process:
        yield process


BANKS = [("cabinet", "cabinet"), ("tool", "tool"), ("modbus", "modbus_slave"), ("profinet", "profinet_slave"),
         ("ethernet_ip", "ethernet_ip_slave")]


def test_inputs_and_outputs_of_the_controller_are_told(arm):
    with collecting(arm.name + "/io_states", IOStates) as received:
        assert eventually(lambda: received), "a late subscriber gets the latched one"
        for bank, field in BANKS:
            arm.simulator.operate("set_input", bank=bank, index=3, value=1)
            arm.simulator.operate("set_input", bank=bank, index=0, signal="analog", value=4.5)
            assert eventually(lambda field=field: getattr(received[-1][1], field).digital_inputs[3]
                              and getattr(received[-1][1], field).analog_inputs[0] == 4.5), field
        assert arm.call("set_io", signal="digital", type=0, index=5, value=1.0).ret == 1
        assert eventually(lambda: received[-1][1].cabinet.digital_outputs[5])
        newest = received[-1][1]
        assert (len(newest.relays), len(newest.extension.digital_inputs)) == (2, 0)
        assert sum(newest.cabinet.digital_inputs) == sum(newest.cabinet.digital_outputs) == 1


def test_an_edge_is_told_within_a_few_frames(arm):
    # The best of several counts: a busy host delays some. The bound is loose; one frame is 8 ms.
    with collecting(arm.name + "/io_states", IOStates) as received:
        assert eventually(lambda: received)
        delays = []
        for n in range(10):
            seen = len(received)
            begun = time.monotonic()
            arm.simulator.operate("set_input", index=7, value=1 - n % 2)
            assert eventually(lambda n=n, seen=seen: any(
                message.cabinet.digital_inputs[7] is (n % 2 == 0) for _, message in received[seen:]))
            delays.append(time.monotonic() - begun)
        assert min(delays) < 0.25, delays


def test_a_silent_controller_is_not_told_of(arm):
    with collecting(arm.name + "/io_states", IOStates) as received:
        assert eventually(lambda: len(received) > 1)
        arm.simulator.operate("refuse", port="status", duration_ms=3000)
        arm.simulator.operate("close", port="status")
        arm.simulator.operate("set_input", index=9, value=1)
        assert eventually(lambda: received[-1][1].cabinet.digital_inputs[9])
    stamps = [message.header.stamp.to_sec() for _, message in received]
    gap = max(after - before for before, after in zip(stamps, stamps[1:]))
    assert gap > 1.5, "nothing came while the feed was down"
    assert rospy.get_time() - stamps[-1] < 60.0
