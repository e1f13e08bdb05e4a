"""A panel on a running driver: the messages of a page, and each of its commands, with one page and with two."""
import contextlib
import math
import os
import signal
import subprocess
import time

import pytest
import rospy
from driver_bench import HOME, LiveDriver
from motion_logs import log_of, session
from panel_page import PROGRAM, Page, PanelProcess, get
from waiting import WAIT, eventually

from jaka_msgs.srv import SetIO
from jaka_ros_driver.kinematics.arm_models import load_model
from jaka_ros_driver.kinematics.forward import forward
from jaka_ros_driver.kinematics.rotations import (
    IDENTITY,
    compose,
    distance_between,
    matrix_from_rotation_vector,
    rotation_angle_between,
    transform,
)

STAGE = [0.2, 1.4, -1.4, 1.5, 1.4, 0.1]
SCRIPT = "<script>alert(1)</script>"


@pytest.fixture(scope="module")
def live(ros_node, tmp_path_factory):
    with LiveDriver(tmp_path_factory.mktemp("panel"), name="seen", guard=False) as live:
        live.arm.wait_until_ready()
        yield live


@pytest.fixture(scope="module")
def panel(live, tmp_path_factory):
    logs = tmp_path_factory.mktemp("logs")
    (logs / "no log.txt").write_text("x")
    (logs / (SCRIPT.replace("/", "") + ".bag")).write_text("x")
    with PanelProcess("--logs", str(logs), "--simulator-panel", str(live.simulator.ports["panel_port"]),
                      "--cell-data", str(logs / "cell" / "cell.json")) as panel:
        panel.logs = logs
        yield panel


@pytest.fixture(scope="module")
def page(loop, panel, live):
    with Page(loop, panel, name="operator") as page:
        assert eventually(lambda: is_seen(page, live.arm.name)), page.messages
        assert page.take_control()
        assert eventually(lambda: newest_arm(page)["simulator"] and newest_arm(page)["joints"])
        yield page


@pytest.fixture
def arm(live):
    return live.arm.name


def newest_arm(page):
    return [m for m in page.messages if m["t"] in ("arms", "welcome")][-1]["arms"][0]


def is_seen(page, arm):
    page.watch(arm, plots=True)
    return eventually(lambda: page.states.get(arm, {}).get("fresh") and page.states[arm]["status"], 1.0)


def joints(live):
    return [math.radians(value) for value in live.simulator.state()["joint_position"]]


def there(live, target, tolerance=1e-3):
    return eventually(lambda: all(abs(a - b) < tolerance for a, b in zip(joints(live), target)))


def go_home(live):
    """Move home; again where a busy host stands against it."""
    assert eventually(lambda: live.arm.call("joint_move", pose=HOME, mvvelo=3.0, mvacc=12.0).ret == 1)


def set_in_motion(page, live, arm, cmd, **args):
    """Ask for a motion from HOME, again where a busy host has ended it before it began; return the function that waits
    for its answer."""
    answers = []
    for _ in range(5):
        go_home(live)
        state(page, arm, lambda s: s["fresh"] and all(abs(a - b) < 1e-3 for a, b in zip(s["q"], HOME)))
        answer = page.begin_command(cmd, arm, **args)
        if eventually(live.simulator.is_moving, 10.0):
            return answer
        answers.append(answer())
    raise AssertionError(answers)


def runs(page, live, arm, plan):
    """Run a plan from its start; again where a busy host has ended it before its end."""
    def done():
        return page.command("joint_move", arm, q=plan["start"], speed=1.0, acc=4.0)["ok"] and page.command(
            "plan_run", arm, plan=plan["plan"])["ok"]
    return eventually(done) and there(live, plan["end"])


def refuses(page, arm, plan, why):
    """Run a plan that is refused for this reason; again where a busy host is another one."""
    said = []

    def done():
        answer = page.command("plan_run", arm, plan=plan["plan"])
        assert not answer["ok"]
        said.append(answer["message"])
        return why in answer["message"]
    assert eventually(done), "%s; not: %s" % (sorted(set(said)), why)
    return True


def state(page, arm, holds):
    assert eventually(lambda: holds(page.states[arm])), page.states[arm]
    return page.states[arm]


def test_the_arm_is_described(page, loop, panel, arm):
    status, headers, body = get(loop, panel, "/description?arm=" + arm)
    assert status == 200 and b"<robot" in body and headers["x-content-type-options"] == "nosniff"
    about = newest_arm(page)
    assert about["id"] == arm and about["model"] == "zu7" and about["simulated"] is True
    assert [joint["name"] for joint in about["joints"]] == ["joint_%d" % n for n in range(1, 7)]
    assert all(joint["lower"] < 0.0 < joint["upper"] and joint["velocity"] > 0.0 for joint in about["joints"])
    assert about["has"]["trajectory"] and about["has"]["programs"] and about["jog"]["linear"] == 0.25


def test_states_come_at_the_rate_at_most_and_show_what_is(page, live, arm):
    go_home(live)
    shown = state(page, arm, lambda s: all(abs(a - b) < 1e-3 for a, b in zip(s["q"], HOME)))
    assert shown["fresh"] and 0.0 <= shown["age"] <= 0.3 and shown["tool"]["frame"] == "base_link"
    assert [1000.0 * value for value in shown["tool"]["p"]] == pytest.approx(
        live.simulator.state()["tcp_pose"][:3], abs=0.5)
    assert shown["robot"]["power"] == 1 and shown["status"]["motion_possible"] is True
    state(page, arm, lambda s: s["owner"] == "nobody" and s["enabled"] is True and s["speed"] == 1.0 and s["want"])
    began, before = time.monotonic(), page.counts["state"]
    assert eventually(lambda: page.counts["state"] >= before + 30)
    assert time.monotonic() - began > 0.9, "more than 30 states a second"


def test_states_come_a_little_behind_a_sample(page, arm):
    # The driver and a simulated controller beside it are busy when a sample comes: no work for pages then. At any
    # moment the newest sample may be 0 to 8 ms old and more; of what is shown most lies within 3 ms.
    def is_behind():
        ages = {}
        assert eventually(lambda: ages.update({page.states[arm]["n"]: page.states[arm]["age"]}) or len(ages) >= 30)
        return sum(0.0025 <= age <= 0.0055 for age in ages.values()) >= 24

    assert eventually(is_behind)


def test_a_sample_that_is_old_is_not_shown_as_new(page, live, arm):
    live.send(signal.SIGSTOP)
    try:
        old = state(page, arm, lambda s: not s["fresh"])
        older = state(page, arm, lambda s: s["age"] > old["age"] + 0.3)
        assert older["q"] == old["q"] and older["n"] > old["n"]
        page.press(arm, [1, 0, 0, 0, 0, 0])
        assert "not fresh" in page.wait("jog", lambda m: m["state"] == "ended")["why"]
        page.let_go_silently()
        # a stop of an arm that does not answer holds up nothing, and is not reported as done
        begun = time.monotonic()
        answer = page.ask("stop", arm=arm)
        assert not answer["ok"] and time.monotonic() - begun < 10.0
    finally:
        live.send(signal.SIGCONT)
    state(page, arm, lambda s: s["fresh"])
    assert eventually(lambda: page.ask("stop", arm=arm)["ok"])


def test_curves_come_as_samples_and_shortened(page, live, arm):
    go_home(live)
    since = len(page.messages)
    assert eventually(lambda: page.command("joint_move", arm, q=STAGE, speed=1.0, acc=4.0)["ok"])
    moved = page.wait("move", lambda m: m["move"]["to"] is not None, since=since)["move"]
    assert moved["to"] - moved["s"] > 0.1 and not moved["lost"], moved
    assert eventually(lambda: page.plots and page.plots[-1]["q"][0][-1] == pytest.approx(STAGE[0], abs=1e-3))
    times = [time for plot in page.plots for time in plot["s"]]
    assert times == sorted(times) and all(len(plot[name][5]) == len(plot["s"]) for plot in page.plots
                                          for name in ("q", "dq", "e"))
    answer = page.ask("history", arm=arm, what="q", to=0, buckets=50, **{"from": -30})
    lowest, highest = (kind(value for value in column if value is not None) for kind, column in (
        (min, answer["min"][0]), (max, answer["max"][0])))
    assert lowest == pytest.approx(HOME[0], abs=1e-3) and highest == pytest.approx(STAGE[0], abs=1e-3)
    assert len(answer["min"][0]) == len(answer["s"]) == len(answer["last"])


def test_an_output_set_by_hand_is_marked_for_all_pages_until_something_else_sets_it(page, panel, loop, live, arm):
    def marks(reader):
        told = [m for m in reader.messages if m["t"] == "by_hand"]
        return told and [(one["index"], one["value"], one["by"]) for one in told[-1]["outputs"]]
    output = {"signal": "digital", "bank": "cabinet"}
    for index in (8, 9):
        assert eventually(lambda index=index: page.command("set_output", arm, **output, index=index, value=True)["ok"])
    both = [(8, True, "operator"), (9, True, "operator")]
    assert eventually(lambda: marks(page) == both), marks(page)
    with Page(loop, panel, name="later") as later:
        later.watch(arm)
        assert eventually(lambda: marks(later) == both), "a page that comes later"
        page.wait("io", lambda m: m["banks"]["cabinet"]["do"][8] and m["banks"]["cabinet"]["do"][9])
        set_io = rospy.ServiceProxy(arm + "/set_io", SetIO)
        assert set_io("digital", 0, 9, 1.0).ret == 1, "by somebody else, to the same value"
        assert eventually(lambda: marks(later) == marks(page) == both[:1]), marks(page)
    for index in (8, 9):
        assert eventually(lambda index=index: page.command("set_output", arm, **output, index=index, value=False)["ok"])
    assert eventually(lambda: marks(page) == [(8, False, "operator"), (9, False, "operator")]), marks(page)


def test_each_setting_does_what_it_says(page, live, arm):
    def ok(cmd, **args):
        answers = []

        def done():
            answers.append(page.command(cmd, arm, **args))
            return answers[-1]["ok"]
        assert eventually(done), (cmd, answers[-1])
        return answers[-1]["data"]
    go_home(live)
    assert ok("set_output", signal="digital", bank="cabinet", index=3, value=True) == {"value": True}
    page.wait("io", lambda m: m["banks"]["cabinet"]["do"][3])
    assert ok("get_io", signal="digital", direction="output", bank="cabinet", index=3) == {"value": True}
    ok("set_output", signal="digital", bank="cabinet", index=3, value=False)
    ok("speed", fraction=0.5)
    state(page, arm, lambda s: s["speed"] == 0.5)
    ok("speed", fraction=1.0)
    ok("collision", level=3)
    ok("collision", level=0)
    ok("tool_frame", number=2, p=[0.0, 0.0, 0.1], r=[0.0, 0.0, 0.0])
    flange = [1000.0 * value for value in ok("fk", q=HOME)["p"]]
    assert flange[2] == pytest.approx(live.simulator.state()["tcp_pose"][2], abs=0.5)
    ok("user_frame", number=1, p=[0.1, 0.0, 0.0], r=[0.0, 0.0, 0.5])
    state(page, arm, lambda s: s["tool"]["frame"].endswith("user_frame_1") and s["tool_id"] == 2 and s["user_id"] == 1)
    pose = ok("present_pose")
    base_t_flange = forward(load_model("zu7"), HOME)
    tip = compose(base_t_flange, transform(IDENTITY[:9], [0.0, 0.0, 0.1]))
    for shown, expected in ((pose["flange"], base_t_flange), (pose["tool"], tip)):
        there = transform(matrix_from_rotation_vector(shown["r"]), shown["p"])
        assert distance_between(there, expected) < 2e-4 and rotation_angle_between(there, expected) < 1e-3, pose
    assert pose["q"] == pytest.approx(HOME, abs=1e-3) and (pose["tool_number"], pose["user_number"]) == (2, 1)
    ok("payload", tool=2, mass=0.5, centre=[0.0, 0.0, 0.05])
    assert page.command("settings", arm)["data"]["payload"] == {"mass": 0.5, "centre": [0.0, 0.0, 0.05]}
    ok("user_frame", number=1, p=[0.0, 0.0, 0.0], r=[0.0, 0.0, 0.0])
    ok("tool_frame", number=2, p=[0.0, 0.0, 0.0], r=[0.0, 0.0, 0.0])
    ok("drag", on=True)
    ok("drag", on=False)
    ok("enable", on=False)
    state(page, arm, lambda s: s["enabled"] is False)
    ok("recover")
    ok("clear_err")
    assert state(page, arm, lambda s: s["enabled"] is True)["robot"]["power"] == 1


def test_a_page_hears_that_zones_have_changed_and_may_ask_for_them_without_control(page, live, arm):
    def zones():
        answer = page.command("zones", arm)
        assert answer["ok"], answer
        return answer["data"]
    assert eventually(lambda: newest_arm(page)["zones"])
    before, told = zones(), newest_arm(page)["zones"]
    assert before == {"keep_out": [], "keep_in": [], "cylinders": [], "tool": []}
    assert eventually(lambda: live.arm.call("set_workspace", yaml="floor: -1.5").ret == 1)
    assert eventually(lambda: newest_arm(page)["zones"] != told)
    assert zones() == dict(before, floor=-1.5)
    assert live.arm.call("set_workspace", yaml="{}").ret == 1


def test_moves_and_their_preview(page, live, arm):
    go_home(live)
    there(live, HOME)
    pose = page.command("fk", arm, q=STAGE)["data"]
    near = page.command("ik", arm, p=pose["p"], r=pose["r"], near=HOME)["data"]["q"]
    assert near == pytest.approx(STAGE, abs=1e-3)
    assert eventually(lambda: page.command("joint_move", arm, q=near, speed=1.0)["ok"]) and there(live, STAGE)
    up = [pose["p"][0], pose["p"][1], pose["p"][2] + 0.02]
    assert eventually(lambda: page.command("linear_move", arm, p=up, r=pose["r"], speed=0.1)["ok"])
    assert live.simulator.state()["tcp_pose"][2] == pytest.approx(1000.0 * up[2], abs=0.5)
    back = {"p": pose["p"], "r": pose["r"], "q": near}  # what the page shows is what the controller makes of it now
    assert "tool or user frame" in page.command("linear_move", arm, **dict(back, p=up), speed=0.1)["message"]
    assert page.command("linear_move", arm, **back, speed=0.1)["ok"] and there(live, STAGE)
    refused = page.command("joint_move", arm, q=[99.0] + HOME[1:], speed=1.0)
    assert not refused["ok"] and "valid" in refused["message"]
    for wrong in ({"q": [0.0], "speed": 1.0}, {"q": HOME, "speed": "x"}, {"q": HOME}, {"q": [None] * 6, "speed": 1.0}):
        assert not page.command("joint_move", arm, **wrong)["ok"]


def test_a_trajectory_is_drawn_before_it_is_run_and_begins_where_the_arm_is(page, live, arm):
    go_home(live)
    there(live, HOME)
    points = [{"t": 0.0, "q": HOME}, {"t": 1.0, "q": [0.1] + HOME[1:]}, {"t": 2.0, "q": STAGE}]
    plan = page.command("plan_points", arm, points=points)["data"]
    assert plan["path"][0] == HOME and plan["path"][-1] == STAGE and plan["duration"] == 2.0
    assert len(plan["path"]) <= 400
    assert runs(page, live, arm, plan) and plan["end"] == STAGE
    away = page.command("plan_run", arm, plan=plan["plan"])
    assert not away["ok"] and "move there first" in away["message"]
    assert "no such plan" in page.command("plan_run", arm, plan="k99")["message"]
    at_1_s = {"t": 1.0, "q": HOME}
    for wrong in ([], [{"t": 1.0, "q": [99.0] * 6}], [at_1_s, at_1_s], [{"t": 0.0, "q": HOME}], [5], "x"):
        assert not page.command("plan_points", arm, points=wrong)["ok"]


def test_a_list_of_motions_is_drawn_run_and_ended_by_whoever_stops_the_arm(page, live, arm):
    pose = page.command("fk", arm, q=STAGE)["data"]

    def beside(x, z):
        p = [pose["p"][0] + x, pose["p"][1], pose["p"][2] + z]
        return page.command("ik", arm, p=p, r=pose["r"], near=STAGE)["data"]["q"]
    points = {"stage": STAGE, "up": beside(0.0, 0.04), "via": beside(0.02, 0.06), "end": beside(0.04, 0.04)}
    page.send(t="cell")
    revision = page.wait("cell")["revision"]
    assert page.command("cell_change", None, revision=revision, changes=[
        {"section": "points", "arm": arm, "name": name, "entry": {"q": q}} for name, q in points.items()])["ok"]
    output = {"kind": "output", "signal": "digital", "bank": "cabinet", "index": 5, "value": True}
    go_home(live)
    assert there(live, HOME)
    plan = page.command("plan_list", arm, steps=[
        {"kind": "joint", "point": "stage", "speed": 1.0}, {"kind": "line", "point": "up", "speed": 0.1}, output,
        {"kind": "wait", "s": 0.1}, {"kind": "arc", "via": "via", "point": "end", "speed": 0.1}])["data"]
    assert plan["path"][0] == pytest.approx(HOME, abs=1e-3) and plan["end"] == pytest.approx(points["end"], abs=1e-3)
    assert runs(page, live, arm, plan), "it arrives"
    page.wait("io", lambda m: m["banks"]["cabinet"]["do"][5])
    assert eventually(lambda: page.command("tool_frame", arm, number=2, p=[0.0, 0.0, 0.05], r=[0.0, 0.0, 0.0])["ok"])
    assert eventually(lambda: page.command("joint_move", arm, q=plan["start"], speed=1.0, acc=4.0)["ok"])
    assert refuses(page, arm, plan, "step 1: tool or user frame are others")
    assert eventually(lambda: page.command("tool_frame", arm, number=2, p=[0.0] * 3, r=[0.0] * 3)["ok"])
    assert eventually(lambda: page.command("joint_move", arm, q=STAGE, speed=1.0, acc=4.0)["ok"])
    assert refuses(page, arm, plan, "step 1: joint") and refuses(page, arm, plan, "move there first")
    plan = page.command("plan_list", arm, steps=[
        {"kind": "line", "point": "up", "speed": 0.1}, {**output, "index": 6}, {"kind": "wait", "s": 60.0},
        {"kind": "joint", "point": "stage", "speed": 1.0}])["data"]

    def is_set():
        return [m for m in page.messages if m["t"] == "io"][-1]["banks"]["cabinet"]["do"][6]

    def ends_in_its_wait():
        page.command("set_output", arm, **{**output, "index": 6, "value": False})
        page.command("joint_move", arm, q=plan["start"], speed=1.0, acc=4.0)
        answer = page.begin_command("plan_run", arm, plan=plan["plan"])
        eventually(is_set, 10.0)
        with contextlib.suppress(rospy.ServiceException):  # a busy host: whether the arm rests is not seen
            live.arm.call("stop_move")
        ended = answer()
        assert not ended["ok"]
        return "step 3" in ended["message"] and "stopped" in ended["message"]
    assert eventually(ends_in_its_wait), "nothing goes on by itself; again where a busy host has ended it before"
    assert there(live, points["up"])
    long = [{"kind": "line", "point": point, "speed": 0.1} for point in ("up", "stage")] * 10
    first, second = (page.begin_command("plan_list", arm, steps=long) for _ in range(2))
    assert "being planned" in second()["message"] and first()["ok"]
    for wrong in ([], "x", [{"kind": "line", "point": "nowhere", "speed": 0.1}], [{"kind": "jump"}]):
        assert not page.command("plan_list", arm, steps=wrong)["ok"]


def test_logs_are_those_of_the_folder_and_a_name_leads_nowhere_else(page, panel, arm):
    names = [log["file"] for log in page.command("logs", None)["data"]["logs"]]
    assert names == [SCRIPT.replace("/", "") + ".bag"]
    for name in ("../../etc/passwd", "/etc/passwd", "no log.txt", "absent.bag", ""):
        assert page.command("plan_log", arm, file=name)["message"] == "no such log"
    assert not page.command("plan_log", arm, file=names[0])["ok"], "that one is no log"


def test_a_log_is_replayed_as_it_was_drawn(page, live, panel, arm):
    log_of(panel.logs / "led.bag", session(seconds=1.5, reach=0.2))
    plan = page.command("plan_log", arm, file="led.bag")["data"]
    assert plan["duration"] > 1.0 and plan["warnings"], "the log lacks the model"
    begin = plan["start"][0]
    peak = max(abs(place[0] - begin) for place in plan["path"])
    page.plots.clear()
    assert runs(page, live, arm, plan)
    assert eventually(lambda: max(abs(value - begin) for plot in page.plots for value in plot["q"][0]) > 0.8 * peak)
    (panel.logs / "led.bag").unlink()


def test_programs(page, arm):
    def done():
        page.command("program_stop", arm)
        return page.command("program_load", arm, name="weld.jks")["ok"] and all(
            page.command("program_" + act, arm)["ok"] for act in ("play", "pause", "resume", "stop"))
    assert eventually(done)
    page.wait("program", lambda m: m["state"] == "running" and m["program"] == "weld.jks")


def test_calls_of_others_are_shown_as_they_come(page, live, arm):
    since = len(page.messages)
    live.arm.call("get_fk", joint=HOME)
    call = page.wait("call", lambda m: m["call"]["name"] == "get_fk" and "jaka_tests" in m["call"]["caller"],
                     since=since)["call"]
    assert call["ok"] and "1.5" in call["request"] and "cartesian_pose" in call["answer"] and call["took"] >= 0.0


def test_the_simulated_button_is_pressed_shown_as_an_alarm_and_recovered_from(page, live, arm):
    since = len(page.messages)
    assert page.command("sim", arm, action="press_emergency_stop")["ok"]
    alarm = page.wait("alarm", lambda m: m["alarm"]["source"] == "controller", since=since)["alarm"]
    page.wait("alarm", lambda m: m["alarm"]["n"] == alarm["n"] and m["alarm"]["text"], since=since)
    state(page, arm, lambda s: s["status"]["e_stopped"] is True and s["robot"]["motion"] == 2)
    assert not page.command("joint_move", arm, q=HOME, speed=1.0)["ok"]
    assert page.command("sim", arm, action="release_emergency_stop")["ok"]
    assert eventually(lambda: page.command("recover", arm)["ok"])
    page.wait("alarm", lambda m: m["alarm"]["n"] == alarm["n"] and m["alarm"]["until"], since=since)
    assert page.command("sim", arm, action="state")["data"]["state"]["is_enabled"]
    for wrong in ({"action": "shutdown"}, {"action": "hit", "force": "x"}, {}):
        assert not page.command("sim", arm, **wrong)["ok"]


def test_a_stop_is_served_to_a_page_without_control_while_a_move_blocks(page, loop, panel, live, arm):
    answer = set_in_motion(page, live, arm, "joint_move", q=[3.0] + HOME[1:], speed=0.3)
    with Page(loop, panel, name="bystander") as other:
        refused = other.command("joint_move", arm, q=HOME, speed=1.0)
        assert not refused["ok"] and "control" in refused["message"]
        assert other.ask("stop", arm=arm)["ok"]
    assert not answer()["ok"]
    assert eventually(lambda: not live.simulator.is_moving())


def test_a_trajectory_ends_with_a_stop_by_post(page, loop, panel, live, arm):
    plan = page.command("plan_points", arm, points=[{"t": 0.0, "q": HOME}, {"t": 20.0, "q": [3.0] + HOME[1:]}])["data"]
    answer = set_in_motion(page, live, arm, "plan_run", plan=plan["plan"])
    status, _, _ = get(loop, panel, "/api/stop?arm=" + arm, "POST", Origin="http://127.0.0.1:%d" % panel.port,
                       Authorization="Bearer " + panel.token, **{"Content-Length": "0"})
    assert status == 200 and not answer()["ok"] and eventually(lambda: not live.simulator.is_moving())


def test_what_a_page_has_set_in_motion_is_stopped_when_it_goes(page, loop, panel, live, arm):
    page.send(t="release_control")
    with Page(loop, panel, name="gone") as other:
        assert eventually(other.take_control) and eventually(lambda: is_seen(other, arm))
        set_in_motion(other, live, arm, "joint_move", q=[3.0] + HOME[1:], speed=0.3)
        other.cut()
        assert eventually(lambda: not live.simulator.is_moving(), WAIT)
    assert abs(joints(live)[0]) < 2.5
    assert eventually(page.take_control)


def test_names_of_the_graph_and_the_controller_come_as_text(page, live, arm):
    since = len(page.messages)
    answer = page.command("program_load", arm, name=SCRIPT)
    call = page.wait("call", lambda m: m["call"]["name"] == "program/load", since=since)["call"]
    assert SCRIPT in call["request"] and isinstance(answer["message"], str)


def test_ctrl_c_ends_the_wait_for_a_master_without_a_traceback():
    environment = dict(os.environ, ROS_MASTER_URI="http://127.0.0.1:1", PYTHONUNBUFFERED="1")
    with subprocess.Popen([*PROGRAM, "--port", "0"], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
                          env=environment) as process:
        assert "master may not be running yet" in process.stdout.readline()
        process.send_signal(signal.SIGINT)
        assert process.communicate(timeout=WAIT)[0] == "" and process.returncode == -signal.SIGINT
