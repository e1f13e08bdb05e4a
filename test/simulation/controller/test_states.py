"""The state machine over the wire: power, drives, stops, servo mode, hand guiding; and the life of events in
errcode."""
import pytest
from raw_client import RawClient, RawFeed
from waiting import wait_until

HOME = [0.0, 90.0, -90.0, 90.0, 90.0, 0.0]
FAR = [170.0, 90.0, -90.0, 90.0, 90.0, 0.0]
MOTION = [
    ("joint_move", {"jointPosition": FAR, "speed": 20}),
    ("moveL", {"cartPosition": [420.0, 115.01, 373.15, 180.0, 0.0, -90.0], "speed": 50}),
    ("end_move", {"endPosition": [420.0, 115.01, 373.15, 180.0, 0.0, -90.0], "speed": 50}),
    ("movc", {"pos_mid": [427.0, 125.01, 373.15, 180.0, 0.0, -90.0],
              "pos_end": [437.0, 115.01, 373.15, 180.0, 0.0, -90.0], "speed": 50}),
    ("jog", {"jog_mode": 1, "coord_map": 1, "jnum": 0, "jogvel": 5}),
]


def start_moving(client, feed):
    assert client.code("joint_move", jointPosition=FAR, speed=20, executing_line_id=9) == "0"
    feed.until(lambda frame: frame["joint_actual_position"][0] > 1.0)


def assert_nothing_moves(arm, client):
    for command, parameters in MOTION:
        assert client.ask(command, **parameters) == {
            "errorCode": "2", "errorMsg": "call %s failed" % command, "cmdName": command}
    assert client.code("torque_control_enable", enable_flag=1) == "2"
    assert client.code("servo_move", relFlag=1) == "2"
    assert not arm.state()["is_moving"]


def test_power_and_drives_take_their_time(make_arm):
    arm = make_arm(start="off", power_delay=8.0, enable_delay=4.0)
    with RawClient(arm.command_port) as client, RawFeed(arm.status_port) as feed:
        frame = feed.frame()
        assert (frame["powered_on"], frame["enabled"], frame["task_state"]) == (0, False, 1)
        assert client.ask("get_robot_state")["power"] == "powered_off"
        assert client.code("enable_robot") == "0"  # too early: no effect
        began = arm.state()["simulated_s"]
        client.send(b'{"cmdName":"power_on"}{"cmdName":"enable_robot"}{"cmdName":"get_robot_state"}')
        frames = feed.until(lambda frame: frame["powered_on"] == 1)
        assert 7.9 < arm.state()["simulated_s"] - began < 12.0
        assert not any(frame["enabled"] for frame in frames) and frames[-1]["task_state"] == 2
        assert [client.reply()["cmdName"] for _ in range(3)] == ["power_on", "enable_robot", "get_robot_state"]
        assert_nothing_moves(arm, client)
        assert client.code("power_on") == "0"  # on already
        began = arm.state()["simulated_s"]
        client.send(b'{"cmdName":"enable_robot"}')
        assert feed.until(lambda frame: frame["enabled"])[-1]["task_state"] == 4
        assert 3.9 < arm.state()["simulated_s"] - began < 8.0
        assert client.reply()["cmdName"] == "enable_robot"
        assert client.code("enable_robot") == "0"
        assert client.code("power_off") == "2"  # disable first
        assert client.code("joint_move", jointPosition=[5.0, *HOME[1:]], speed=50) == "0"


def test_the_state_is_true_when_the_reply_comes(make_arm):
    # Published scripts need it: they ask for the state straight after the reply (docs/sdk-client.md section 9).
    arm = make_arm(start="off", power_delay=8.0, enable_delay=4.0)
    with RawClient(arm.command_port) as client:
        assert client.code("power_on") == "0"
        assert client.ask("get_robot_state")["power"] == "powered_on"
        assert client.code("enable_robot") == "0"
        assert client.ask("get_robot_state")["enable"] == "robot_enabled"


def test_an_emergency_stop_ends_what_a_reply_waits_for(make_arm):
    arm = make_arm(start="off", power_delay=1000.0, time_scale=1.0)
    with RawClient(arm.command_port) as client:
        client.send(b'{"cmdName":"power_on"}{"cmdName":"stop_program"}')
        arm.operate("press_emergency_stop")
        assert client.reply() == {"errorCode": "2", "errorMsg": "call power_on failed", "cmdName": "power_on"}
        assert client.reply()["errorCode"] == "0"
        assert not arm.state()["is_powered"]


def test_nothing_moves_without_power_or_drives(make_arm):
    for start in ("off", "powered"):
        arm = make_arm(start=start)
        with RawClient(arm.command_port) as client:
            assert_nothing_moves(arm, client)


def test_disabling_announces_itself(arm, client, feed):
    # The event code precedes the flags, and stays until the drives are enabled (checklist 9).
    for _ in range(10):  # a host that stands still sends no frame between the code and the flags
        assert client.code("disable_robot") == "0"
        frames = feed.until(lambda frame: not frame["enabled"])
        announced = [frame for frame in frames if frame["enabled"] and frame["errcode"] == "0x10f0005"]
        if announced:
            break
        assert client.code("enable_robot") == "0"
        feed.until(lambda frame: frame["enabled"])
    assert announced and frames[-1]["errcode"] == "0x10f0005" and frames[-1]["errmsg"] == "robot servo disabled"
    assert frames[-1]["task_state"] == 3
    assert_nothing_moves(arm, client)
    assert client.code("enable_robot") == "0"
    assert feed.until(lambda frame: frame["enabled"])[-1]["errcode"] == "0x0"
    assert client.code("disable_robot") == "0"
    feed.until(lambda frame: not frame["enabled"])
    assert client.code("clear_error") == "0"
    assert feed.until(lambda frame: frame["errcode"] == "0x0")[-1]["errmsg"] == ""
    assert client.code("power_off") == "0"
    feed.until(lambda frame: frame["powered_on"] == 0 and frame["task_state"] == 1)


def test_disabling_is_refused_in_motion(arm, client, feed):
    start_moving(client, feed)
    assert client.code("disable_robot") == "2"
    assert client.code("stop_program") == "0"


def test_motion_is_queued_and_stopped(arm, client, feed):
    start_moving(client, feed)
    assert client.code("joint_move", jointPosition=HOME, speed=20) == "0"
    assert client.ask("get_motion_state")["queue"] == 2
    assert client.code("servo_move", relFlag=1) == "0"  # accepted, and stays out: motion is pending
    assert client.ask("is_in_servomove")["in_servomove"] is False
    assert client.code("servo_j", jointPosition=HOME) == "-1"
    assert client.code("stop_program") == "0"
    feed.until(lambda frame: frame["inpos"])
    stopped = arm.state()["joint_position"]
    assert 0.0 < stopped[0] < 169.0 and arm.state()["queue_length"] == 0
    assert feed.frame()["errcode"] == "0x0"
    assert client.code("joint_move", jointPosition=HOME, speed=90) == "0"
    assert client.code("wait_complete") == "0" and arm.state()["joint_position"] == HOME


def test_pause_and_resume_of_a_move(arm, client, feed):
    start_moving(client, feed)
    assert client.code("pause_program") == "0"
    wait_until(lambda: not arm.state()["is_moving"], "the pause")
    assert feed.until(lambda frame: frame["paused"])[-1]["inpos"] is False
    paused_at = arm.state()["joint_position"][0]
    assert client.code("resume_program") == "0"
    feed.until(lambda frame: frame["joint_actual_position"][0] > paused_at + 1.0)
    assert client.code("stop_program") == "0"
    feed.until(lambda frame: frame["inpos"] and not frame["paused"])


def test_emergency_stop_and_the_way_back(arm, client, feed):
    start_moving(client, feed)
    arm.operate("press_emergency_stop")
    frame = feed.until(lambda frame: frame["emergency_stop"] == 1)[-1]
    assert (frame["powered_on"], frame["enabled"], frame["task_state"]) == (0, False, 1)
    assert (frame["errcode"], frame["errmsg"]) == ("0x309082", "emergency stop triggered")
    wait_until(lambda: not arm.state()["is_moving"], "standstill")
    assert arm.state()["queue_length"] == 0
    assert client.code("clear_error") == "0"  # software cannot release it
    assert client.code("power_on") == "2" and client.code("enable_robot") == "2"
    assert_nothing_moves(arm, client)
    assert feed.frame()["errcode"] == "0x309082"
    arm.operate("release_emergency_stop")
    frame = feed.until(lambda frame: frame["emergency_stop"] == 0)[-1]
    assert (frame["powered_on"], frame["errcode"]) == (0, "0x309082")  # nothing comes back by itself
    assert client.code("clear_error") == "0"
    feed.until(lambda frame: frame["errcode"] == "0x0")
    assert_nothing_moves(arm, client)
    assert client.code("power_on") == "0"
    feed.until(lambda frame: frame["powered_on"] == 1)
    assert client.code("enable_robot") == "0"
    feed.until(lambda frame: frame["enabled"])
    assert not arm.state()["is_moving"] and arm.state()["queue_length"] == 0
    assert client.code("joint_move", jointPosition=HOME, speed=90) == "0"


def test_emergency_stop_while_energising(make_arm):
    arm = make_arm(start="off", power_delay=2.0)
    with RawClient(arm.command_port) as client:
        assert client.code("power_on") == "0"
        arm.operate("press_emergency_stop")
        arm.operate("release_emergency_stop")
        began = arm.state()["simulated_s"]
        wait_until(lambda: arm.state()["simulated_s"] > began + 5.0, "the delay to pass")
        assert not arm.state()["is_powered"]


@pytest.mark.parametrize("level", [1, 3, 5])
def test_collision_depends_on_the_level(arm, client, feed, level):
    assert client.code("set_clsn_sensitivity", sensitivityVal=level) == "0"
    start_moving(client, feed)
    assert arm.operate("hit", force=25.0 * level - 1.0)["noticed"] is False
    assert feed.frame()["protective_stop"] == 0
    assert arm.operate("hit", force=25.0 * level)["noticed"] is True
    frame = feed.until(lambda frame: frame["protective_stop"] == 1)[-1]
    assert frame["errcode"] == "0xf0034" and frame["enabled"] is True and frame["powered_on"] == 1
    wait_until(lambda: not arm.state()["is_moving"], "standstill")
    assert client.ask("protective_stop_status")["protective_stop"] == 1
    assert_nothing_moves(arm, client)
    assert client.code("enable_robot") == "2"
    assert client.code("clear_error") == "0"
    frame = feed.until(lambda frame: frame["protective_stop"] == 0)[-1]
    assert frame["errcode"] == "0x0" and arm.state()["queue_length"] == 0
    assert not arm.state()["is_moving"]  # and nothing resumes
    assert client.code("joint_move", jointPosition=HOME, speed=90) == "0"


def test_collision_detection_switched_off_and_of_one_joint(arm, client, feed):
    assert client.code("set_clsn_sensitivity", sensitivityVal=0) == "0"
    assert arm.operate("hit", force=100000.0)["noticed"] is False
    assert client.code("set_clsn_sensitivity", sensitivityVal=1) == "0"
    assert arm.operate("hit", force=100.0, joint=3)["noticed"] is True
    assert feed.until(lambda frame: frame["protective_stop"])[-1]["errcode"] == "0x20061"


def test_collision_in_servo_mode_and_the_way_back(arm, client, feed):
    # The way is clear_error, then servo_move 1 (docs/controller-protocol.md section 5.6.7).
    assert client.code("servo_move", relFlag=1) == "0"
    for step in range(1, 20):
        assert client.code("servo_j", jointPosition=[0.2 * step, *HOME[1:]]) == "0"
    arm.operate("hit")
    feed.until(lambda frame: frame["protective_stop"])
    assert client.ask("is_in_servomove")["in_servomove"] is False
    assert client.code("servo_j", jointPosition=HOME) == "-1"
    assert client.code("servo_move", relFlag=1) == "2"
    assert client.code("clear_error") == "0"
    wait_until(lambda: not arm.state()["is_moving"], "standstill")
    assert client.code("servo_move", relFlag=1) == "0"
    assert client.ask("is_in_servomove")["in_servomove"] is True


def test_servo_mode_has_rules_of_its_own(arm, client, feed):
    outside = client.ask("servo_j", jointPosition=HOME)
    assert outside == {"errorCode": "-1", "cmdName": "servo_j",
                       "errorMsg": "servoj command can only be excuted in servo move mode"}
    assert client.ask("servo_p", catPosition=[0.0] * 6)["errorCode"] == "-1"
    assert feed.frame()["errcode"] == "0x0"
    assert client.code("servo_move", relFlag=1) == "0"
    for command, parameters in MOTION:
        assert client.code(command, **parameters) == "-1"
    assert client.code("set_servo_move_filter", filter_type=0) == "-1"
    assert client.code("servo_j", jointPosition=[100.0, *HOME[1:]]) == "0"  # over 180 deg/s: taken and ignored
    for step in range(1, 30):
        assert client.code("servo_j", jointPosition=[0.1 * step, *HOME[1:]]) == "0"
    assert client.code("servo_j", relFlag=1, jointPosition=[0.1, 0, 0, 0, 0, 0], stepNum=4) == "0"
    assert client.code("servo_j", jointPosition=[1, 2, 3], stepNum=1) == "2"
    assert client.code("servo_j", jointPosition=HOME, stepNum=0) == "2"
    wait_until(lambda: abs(arm.state()["joint_position"][0] - 3.0) < 1e-6, "the stream's end")
    assert client.code("servo_move", relFlag=0) == "0"
    wait_until(lambda: client.ask("is_in_servomove")["in_servomove"] is False, "the end of servo mode")
    assert client.code("set_servo_move_filter", filter_type=0) == "0"


def test_jog_runs_until_it_is_stopped(arm, client, feed):
    assert client.code("jog", jog_mode=1, coord_map=1, jnum=2, jogvel=-5.0) == "0"
    feed.until(lambda frame: frame["joint_actual_position"][2] < -92.0)
    assert client.code("jog", jog_mode=0, coord_map=0, jnum=5) == "0"  # another axis: still a wish to stop
    assert client.code("wait_complete") == "0"
    assert client.code("jog", jog_mode=2, coord_map=0, jnum=2, jogvel=1.0, poscmd=-10.0) == "0"
    assert client.code("jog", jog_mode=1, coord_map=1, jnum=0, jogvel=5.0) == "0"  # dropped: the other one runs
    assert client.code("wait_complete") == "0"
    assert abs(arm.state()["joint_position"][0]) < 1.0
    before = arm.state()["tcp_pose"][2]
    assert client.code("jog", jog_mode=2, coord_map=0, jnum=2, jogvel=100.0, poscmd=10.0) == "0"
    wait_until(lambda: abs(arm.state()["tcp_pose"][2] - before - 10.0) < 1e-3, "10 mm up")
    assert client.code("jog", jog_mode=0, coord_map=1, jnum=77) == "0"


def test_hand_guiding(arm, client, feed):
    assert arm.operate("push", joint=1, velocity=10.0)["pushed"] is False
    assert client.code("torque_control_enable", enable_flag=1) == "0"
    frame = feed.until(lambda frame: frame["drag_status"])[-1]
    assert frame["task_mode"] == 4
    for command, parameters in MOTION:
        assert client.code(command, **parameters) == "2"
    assert client.code("set_clsn_sensitivity", sensitivityVal=1) == "2"
    assert arm.operate("push", joint=1, velocity=10.0, duration=1.0)["pushed"] is True
    feed.until(lambda frame: frame["joint_actual_position"][0] > 5.0)
    wait_until(lambda: not arm.state()["is_moving"], "the end of the push")
    assert 5.0 < arm.state()["joint_position"][0] < 30.0
    before = arm.state()["joint_position"][1]
    assert arm.operate("push", joint=2, velocity=1.0, duration=0.1)["pushed"] is True
    assert arm.operate("push", joint=2, velocity=10.0, duration=2.0)["pushed"] is True
    wait_until(lambda: abs(arm.state()["joint_position"][1] - before) > 10.0, "a push after the one before")
    wait_until(lambda: not arm.state()["is_moving"], "the end of the push")
    assert client.code("torque_control_enable", enable_flag=0) == "0"
    assert feed.until(lambda frame: not frame["drag_status"])[-1]["task_mode"] == 1
    start_moving(client, feed)
    assert client.code("torque_control_enable", enable_flag=1) == "2"


def test_jog_past_a_limit_is_refused_and_on_it_the_feed_says_so(arm, client, feed):
    assert client.code("joint_move", jointPosition=[0.0, 90.0, -90.0, 90.0, 90.0, 355.0], speed=180) == "0"
    assert client.code("wait_complete") == "0"
    assert client.code("jog", jog_mode=2, coord_map=1, jnum=5, jogvel=20.0, poscmd=20.0) == "2"
    assert client.code("jog", jog_mode=1, coord_map=1, jnum=5, jogvel=20.0) == "0"
    frame = feed.until(lambda frame: frame["on_soft_limit"] == 1)[-1]
    assert frame["drag_near_limit"][5] == 1
    feed.until(lambda frame: frame["errcode"] == "0x50035")
    assert client.code("wait_complete") == "0"
    assert client.code("jog", jog_mode=0, coord_map=1, jnum=5) == "0"
    assert client.code("jog", jog_mode=1, coord_map=1, jnum=5, jogvel=20.0) == "2"
    assert client.code("jog", jog_mode=2, coord_map=1, jnum=5, jogvel=20.0, poscmd=-10.0) == "0"  # away from it
    frame = feed.until(lambda frame: frame["on_soft_limit"] == 0)[-1]
    feed.until(lambda frame: frame["errcode"] == "0x0")


def test_rapid_rate_in_motion(arm, client, feed):
    start_moving(client, feed)
    assert client.code("rapid_rate", rate_value=0.0) == "0"
    wait_until(lambda: not arm.state()["is_moving"], "standstill at rate 0")
    assert feed.until(lambda frame: frame["rapidrate"] == 0.0)[-1]["inpos"] is False
    assert client.code("rapid_rate", rate_value=1) == "0"
    wait_until(lambda: arm.state()["is_moving"], "motion at rate 1")
    assert client.code("stop_program") == "0"


def test_held_reply_blocks_the_channel_until_motion_ends(arm, client, feed):
    assert client.code("joint_move", jointPosition=[60.0, *HOME[1:]], speed=20) == "0"
    client.send(b'{"cmdName":"wait_complete"}{"cmdName":"get_joint_pos"}')
    assert client.reply()["cmdName"] == "wait_complete"
    assert client.reply()["joint_pos"][0] == 60.0
