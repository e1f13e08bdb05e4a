"""Values that no field should have: a controller that sends them ends neither log nor rosout, diagnostics or calls."""
import pytest
from diagnostic_msgs.msg import DiagnosticArray
from driver_bench import LiveDriver, collecting
from rosgraph_msgs.msg import Log
from waiting import eventually

HALF = "half \ud800 of it \x1b[2J\n"


@pytest.fixture(scope="module")
def live(ros_node, tmp_path_factory):
    with LiveDriver(tmp_path_factory.mktemp("hostile"), name="hostile", guard=False) as running:
        running.arm.wait_until_ready()
        yield running


@pytest.fixture
def arm(live):
    yield live.arm
    live.arm.simulator.operate("clear_faults")
    live.arm.wait_until_ready()


def test_texts_that_nothing_can_write_stop_neither_log_nor_rosout_nor_diagnostics(arm):
    with collecting("/rosout_agg", Log) as logged, collecting("/diagnostics", DiagnosticArray) as reports:
        arm.simulator.operate("fields", add={"errcode": "0xf0017", "errmsg": HALF})

        def events():
            return [status.message for _, array in reports for status in array.status
                    if status.name.startswith("hostile") and "0xF0017" in status.message]

        assert eventually(lambda: len(events()) > 3), "diagnostics have ended"
        assert all("half ? of it ?[2J" in event for event in events())
        refused = arm.call("joint_move", pose=[0.0, 1.5, -1.5, 1.5, 1.5, 0.0], mvvelo=-1.0, mvacc=1.0)
        assert refused.ret == 0
        count = len(logged)
        arm.simulator.operate("clear_faults")
        arm.call("joint_move", pose=[0.0, 1.5, -1.5, 1.5, 1.5, 0.0], mvvelo=-2.0, mvacc=1.0)
        assert eventually(lambda: any("mvvelo is -2" in message.msg for _, message in logged[count:])), (
            "rosout has ended")


@pytest.mark.parametrize("fields", [
    {"ain": [10 ** 400]}, {"aout": [1e39]}, {"tio_ain": [1e300, -1e300]}, {"din": [2 ** 70]},
    {"current_tool_id": 1e300}, {"errcode": 10 ** 400}, {"errcode": "0x" + "f" * 60}, {"errmsg": {"\ud800": 1}},
    {"rapidrate": 1e20}, {"monitor_data": [1e39] * 6}, {"motion_line": 10 ** 30}], ids=lambda fields: str(fields)[:30])
def test_numbers_that_nothing_can_hold_end_no_call_and_are_forgotten_with_the_next_good_frame(arm, fields):
    arm.simulator.operate("fields", add=fields)
    for signal, path in (("analog", 0), ("analog", 1), ("digital", 0), ("digital", 1)):
        for bank in (0, 1):
            reply = arm.call("get_io", signal=signal, path=path, type=bank, index=0)
            assert reply.message and abs(reply.value) < 1e9 or reply.message.startswith("error: ")
    arm.simulator.operate("clear_faults")
    assert eventually(lambda: arm.call("get_io", signal="digital", path=1, type=0, index=0).value == 0.0)


def test_the_driver_says_no_traceback(live):
    # The last one: it ends the driver. It needs none of the others, so that it can be repeated by itself.
    live.arm.simulator.operate("fields", add={"errcode": "0xf0017", "errmsg": HALF})
    assert eventually(lambda: live.arm.listen("robot_states", 1)[0].motion_state == 4)
    live.arm.call("joint_move", pose=[0.0, 1.5, -1.5, 1.5, 1.5, 0.0], mvvelo=-2.0, mvacc=1.0)
    code, said = live.end_driver()
    assert code == 0 and "Traceback" not in said and "\x1b[2J" not in said, said
    assert "mvvelo is -2" in said, "the screen has ended"
