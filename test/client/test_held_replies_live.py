"""Calls while the simulated controller holds its replies back until the drives have power; sockets are real."""
import time

import pytest
from waiting import InBackground, StallWatch, eventually

from jaka_ros_driver import commands as c
from jaka_ros_driver.client.core.procedures import power
from jaka_ros_driver.errors import InvalidCommand


def test_calls_beside_power_on_are_refused_soon_and_a_stop_is_served(bench):
    one = bench(start="off", power_delay=4.0)
    arm = one.connect()
    powered = InBackground(arm.run, lambda core: power.set_power(core, True))
    assert eventually(lambda: one.requests("power_on"))
    with StallWatch() as host:
        for _ in range(3):
            began = time.monotonic()
            with pytest.raises(InvalidCommand, match="until power_on is done"):
                arm.execute(c.SetCollisionLevel(3))
            assert host.between(began) < 2.0, "a loose bound on 0.9 s"
    arm.stop()
    assert not powered.is_over and arm.link_health.connections == 1
    powered.join()
    assert eventually(lambda: arm.execute(c.SetCollisionLevel(3)) is None)
    assert one.requests("set_clsn_sensitivity") == 1 and arm.link_health.connections == 1
