"""A result that no float32 can hold is a failed call with a reason, not a response that cannot be written."""
import io
import math

import pytest

from jaka_msgs.srv import GetFKRequest, GetIKRequest, GetIORequest
from jaka_ros_driver.commands import Pose
from jaka_ros_driver.kinematics.arm_models import load_model
from jaka_ros_driver.ros.audit.recorder import Recorder
from jaka_ros_driver.ros.convert import RequestDecoder
from jaka_ros_driver.ros.services.handlers import ServiceOutcome
from jaka_ros_driver.ros.services.table import SERVICES, Services

HOME = [0.0, 1.5, -1.5, 1.5, 1.5, 0.0]
SPECS = {spec.name: spec for spec in SERVICES}
REQUESTS = {"get_io": GetIORequest("analog", 1, 0, 0), "get_fk": GetFKRequest(HOME), "get_ik": GetIKRequest(HOME, HOME)}
POSE = Pose((0.4, 0.0, 0.3), (0.1, 0.2, 0.3))


def response_of(service, value, is_vendor):
    """Return the response, and whether the call counts as a success; it is written as rospy does."""
    spec = SPECS[service]._replace(perform=lambda operations, command: ServiceOutcome("read", value))
    services = Services(RequestDecoder(load_model("zu7"), is_vendor), None, None, Recorder(None))
    outcome = services._outcome(spec, REQUESTS[service], lambda: None)
    response = spec.srv_type._response_class()
    spec.report(response, outcome, is_vendor)
    response.serialize(io.BytesIO())
    return response, outcome.is_success


HUGE = [1e39, -1e39, math.inf, math.nan, 10 ** 400]


@pytest.mark.parametrize("is_vendor", [False, True])
@pytest.mark.parametrize("service, value", [
    *[("get_io", huge) for huge in HUGE], *[("get_ik", (*HOME[:5], huge)) for huge in HUGE],
    *[("get_fk", Pose((0.4, huge, 0.3), POSE.rpy)) for huge in HUGE[:4]],
    *[("get_fk", Pose(POSE.position, (0.1, huge, 0.3))) for huge in HUGE], ("get_io", "4.5")])
def test_a_result_that_float32_cannot_hold_fails_the_call(service, value, is_vendor):
    response, is_success = response_of(service, value, is_vendor)
    assert not is_success and "float32" in response.message
    failed, _ = response_of(service, math.nan, is_vendor)
    failed.message = response.message
    assert repr(response) == repr(failed), "as any other failure"


@pytest.mark.parametrize("service, value", [("get_io", -3.4e38), ("get_io", 1), ("get_ik", tuple(HOME)),
                                            ("get_fk", POSE)])
def test_other_results_are_told(service, value):
    response, is_success = response_of(service, value, False)
    assert is_success and response.message == "read"


def test_services_that_only_our_own_messages_have_are_offered():
    assert {"set_speed_slider", "program/load"} <= set(SPECS)


def test_the_end_waits_for_calls_under_way_and_says_when_one_is_left(caplog):
    services = Services(None, None, None, Recorder(None))
    services.finish_calls(0.01)
    assert not caplog.records
    with services._calls:
        services.finish_calls(0.01)
    assert "not answered" in caplog.text
