"""The driver's process dies or freezes in mid-motion; the guard stops the arm. Verdicts from the controller's log."""
import os
import signal
import subprocess
import sys
import time

import pytest
from arm_bench import fill
from guarded_driver import ROOT
from waiting import WAIT, StallWatch, eventually

from jaka_ros_driver.client.driver_pipe import OUTLIVED, STOPPING, WATCHING
from jaka_ros_driver.client.guard_post import GuardPost
from jaka_ros_driver.client.process_state import waits_for_processor
from jaka_ros_driver.simulation.controller.command_spec import CommandSpec
from jaka_ros_driver.simulation.controller.command_table import COMMANDS
from jaka_ros_driver.simulation.controller.replies import CommandRefused


@pytest.fixture
def answer_stops(monkeypatch):
    """Let the controller react otherwise to some stops: ``reactions`` are called one after the other, and the ends of
    jogs that come with such a stop end none.

    It does not stop the arm itself when its client is lost: on a busy computer it would do so before the guard comes.
    """
    def replace(name, handle):
        monkeypatch.setitem(COMMANDS, name, CommandSpec(name, COMMANDS[name].section, handle))

    def install(*reactions):
        stop, jog, left, reacted = COMMANDS["stop_program"], COMMANDS["jog"], list(reactions), []

        def stopped(state, arguments):
            reacted[:] = left[:1]
            if left:
                left.pop(0)(state)
            else:
                stop.handler(state, arguments)

        def jogged(state, arguments):
            if arguments.integer("jog_mode") != 0 or not reacted:
                jog.handler(state, arguments)
        replace("set_network_exception_handle", lambda state, arguments: None)
        replace("stop_program", stopped)
        replace("jog", jogged)

    return install


def accept_and_go_on(_state):
    """Return the reply to an accepted stop, and let the motion go on."""


def refuse(_state):
    raise CommandRefused("2")


def is_stopped(one):
    return not one.is_moving() and not one.controller.state()["is_servo_active"]


def gaps_between(times):
    return [after - before for before, after in zip(times, times[1:])]


def opened(one):
    """Return when connections to the command port began."""
    return [event.time_ns * 1e-9 for event in one.log().wire("command", "open")]


# ---- the driver dies or freezes ----

@pytest.mark.parametrize("motion", ["move", "jog", "servo"])
@pytest.mark.parametrize("death", [signal.SIGKILL, signal.SIGSTOP])
def test_the_arm_is_stopped_when_the_driver_dies_or_freezes(driver, motion, death):
    one, process = driver(motion)
    with StallWatch() as host:
        died_at = time.monotonic()
        process.send(death)
        assert eventually(lambda: is_stopped(one))
        if death == signal.SIGKILL:
            assert eventually(lambda: not process.guards()), "the guard outlives the driver"
        else:
            assert process.hears("the arm is at rest")
        said = process.kill()
        assert "the controller accepted the stop" in said and "the arm is at rest" in said, said
        stops = one.log().times_of("stop_program", after=died_at)
        assert host.between(died_at, stops[0]) < 3.0, "a loose bound: a busy computer may let the guard wait"
    left = one.log().times_of("servo_move", after=died_at, relFlag=0)
    assert left and left[0] <= stops[0]


def test_the_arm_is_stopped_though_nobody_reads_what_the_guard_says(driver):
    one, process = driver("jog")
    fill(process.process.stderr)
    process.send(signal.SIGSTOP)
    assert eventually(lambda: not one.is_moving())
    process.send(signal.SIGKILL)
    assert eventually(lambda: not process.guards()), "a guard without a beat outlives its driver"
    assert one.times_of("stop_program")


def test_a_driver_that_dies_idle_is_none_of_the_guards_business(driver):
    one, process = driver("idle")
    assert process.watched()
    process.send(signal.SIGKILL)
    assert eventually(lambda: not process.guards())
    assert one.times_of("stop_program") == []


def test_a_driver_that_leaves_in_good_order_takes_its_guard_along(driver):
    one, process = driver("jog")
    said = process.leave()
    assert process.process.returncode == 0 and "guard" not in said, said
    assert not process.guards()
    assert len(one.times_of("stop_program")) == 1


def test_an_arm_that_could_not_be_stopped_at_shutdown_is_stopped_by_the_guard(driver):
    one, process = driver("jog")
    one.operate("refuse", port="command", duration_ms=2000)
    one.operate("close", port="command")
    process.order("leave")
    assert eventually(lambda: not one.is_moving())
    assert eventually(lambda: not process.guards())
    assert one.times_of("stop_program")


def test_an_arm_left_to_a_frozen_guard_at_shutdown_is_stopped_by_another(driver):
    one, process = driver("jog")
    os.kill(process.watched(), signal.SIGSTOP)
    one.operate("refuse", port="command", duration_ms=1000)
    one.operate("close", port="command")
    process.order("leave")
    assert eventually(lambda: not one.is_moving())
    assert eventually(lambda: not process.guards())


def test_a_guard_that_never_hears_a_word_of_its_driver_stops_what_the_driver_moved(driver):
    one, process = driver("jog")
    pid = process.watched()
    process.send(signal.SIGSTOP)
    os.kill(pid, signal.SIGKILL)
    assert one.is_moving()
    subprocess.run(guard_of(one, process.process.pid, "--moving"), stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
                   check=True, timeout=WAIT, cwd=str(ROOT))
    assert eventually(lambda: not one.is_moving())


@pytest.mark.parametrize("number", OUTLIVED, ids=lambda number: number.name)
def test_what_asks_every_process_to_end_leaves_a_frozen_driver_its_guard(driver, number):
    # as systemd does with all processes of a service, or when the computer is shut down
    one, process = driver("jog")
    guard = process.watched()
    process.send(signal.SIGSTOP)
    os.kill(guard, number)
    process.send(number)
    assert eventually(lambda: not one.is_moving())
    assert process.guards() == [guard]
    process.send(signal.SIGKILL)
    assert eventually(lambda: not process.guards()), "the guard outlives the driver"


def test_a_guard_that_is_asked_to_end_while_it_starts_stops_the_arm(driver):
    one, process = driver("jog")
    pid = process.watched()
    process.send(signal.SIGSTOP)
    os.kill(pid, signal.SIGKILL)
    post = GuardPost(time.monotonic())
    post.launch(guard_of(one, process.process.pid, "--moving"))
    for number in OUTLIVED:
        post._process.send_signal(number)
    post.leave()
    assert post.has_exited(WAIT) and post._process.returncode == 0
    assert eventually(lambda: not one.is_moving())
    assert not signal.pthread_sigmask(signal.SIG_BLOCK, ()) & set(OUTLIVED), "they are kept from the driver"


def test_the_last_of_several_answers_says_whether_the_guard_stops_the_arm():
    post = GuardPost(1.0)
    post._its_answers.write(WATCHING + STOPPING)
    assert post.listen(2.0) and post.is_stopping, "it has just begun"
    post._its_answers.write(STOPPING + WATCHING)
    assert not post.listen(3.0) and not post.is_stopping and post.received_at == 3.0
    assert not post.listen(4.0) and post.received_at == 3.0 and not post.has_ended, "nothing has come"
    post._its_answers.close()
    assert not post.listen(5.0) and post.has_ended
    for pipe in (post._its_words, post._words, post._answers):
        pipe.close()


def guard_of(one, driver, *options):
    """Return the command line of a guard that the test itself starts."""
    return [sys.executable, "-m", "jaka_ros_driver.client.guard_process", "--host", "127.0.0.1",
            "--port", str(one.controller.command_port), "--status-port", str(one.controller.status_port),
            "--driver", str(driver), *options]


# ---- the stop ----

def test_a_refused_stop_is_repeated_until_it_is_accepted(driver, answer_stops):
    answer_stops(*[refuse] * 5)
    one, process = driver("jog")
    process.send(signal.SIGKILL)
    assert eventually(lambda: not one.is_moving())
    assert eventually(lambda: not process.guards())
    said = process.kill()
    assert said.count("controller rejected stop_program: code 2") == 1, "each of them is logged: %s" % said
    stops = one.times_of("stop_program")
    assert len(stops) == 6
    assert all(gap > 0.04 for gap in gaps_between(stops)) and sorted(gaps_between(stops))[2] < 1.0


@pytest.mark.parametrize("death", [signal.SIGKILL, signal.SIGSTOP])
def test_an_arm_that_moves_on_after_an_accepted_stop_is_stopped_again(driver, answer_stops, death):
    answer_stops(*[accept_and_go_on] * 4)
    one, process = driver("jog")
    process.send(death)
    assert eventually(lambda: not one.is_moving()), "an accepted stop was taken for rest"
    assert process.hears("the arm is at rest")
    said = process.kill()
    assert "the arm moves on" in said and "the arm is at rest" in said
    stops = one.times_of("stop_program")
    assert 5 <= len(stops) <= 10, "a computer that stands still may see the rest late"
    assert sorted(gaps_between(stops))[2] > 0.3, "a computer that stands still may send two late, one behind the other"


@pytest.mark.parametrize("kind", ["noise", "close", "reset", "drop"])
def test_a_stop_whose_reply_is_lost_is_repeated(driver, answer_stops, kind):
    answer_stops(accept_and_go_on)
    one, process = driver("jog")
    one.operate("fault", kind=kind, port="command", command="stop_program", count=1)
    process.send(signal.SIGKILL)
    assert eventually(lambda: not one.is_moving())
    assert eventually(lambda: not process.guards())
    assert "the arm is at rest" in process.kill()


@pytest.mark.parametrize("blindness", ["refused", "silent", "without joints"])
def test_an_arm_that_cannot_be_seen_is_sent_three_stops(driver, blindness):
    one, process = driver("jog")
    process.send(signal.SIGSTOP)  # else it stops the arm itself, when it sees nothing any more
    died_at = time.monotonic()
    if blindness == "refused":
        one.operate("refuse", port="status", duration_ms=60000)
        one.operate("close", port="status")
    elif blindness == "silent":
        one.operate("stall", port="status", duration_ms=60000)
    else:
        one.operate("fields", drop=["joint_actual_position"])
    process.send(signal.SIGKILL)
    assert eventually(lambda: not process.guards())
    said = process.kill()
    assert "whether the arm is at rest could not be seen: status " in said and "accepted 3 stops" in said, said
    stops = one.log().times_of("stop_program", after=died_at)[-3:]  # one before: of its freezing, on a busy host
    assert len(stops) == 3 and all(0.3 < gap < 5.0 for gap in gaps_between(stops))


# ---- a frozen driver thaws ----

@pytest.mark.parametrize("single_client", ["replace", "coexist"])
def test_a_frozen_driver_that_thaws_does_not_resume_and_does_not_fight(driver, single_client):
    one, process = driver("jog", single_client=single_client)
    guard = process.watched()
    process.send(signal.SIGSTOP)
    assert eventually(lambda: not one.is_moving())
    process.send(signal.SIGCONT)
    thawed_at = time.monotonic()
    time.sleep(1.0)  # what must not come has no other sign
    assert not one.is_moving()
    health = process.health()
    assert process.guards() == [guard] and health["replacements"] == 0
    assert "found this driver silent" in health["last_trouble"]
    assert "found this driver silent" in process.leave()
    assert len(one.log().times_of("jog", jog_mode=1)) == 1
    assert len([at for at in opened(one) if at > thawed_at]) <= 1, "driver and guard fight for the command port"


@pytest.mark.parametrize("single_client", ["replace", "coexist"])
def test_a_driver_that_thaws_and_freezes_again_is_stopped_again(driver, single_client):
    one, process = driver("jog", single_client=single_client)
    guard = process.watched()
    for _ in range(2):
        process.send(signal.SIGSTOP)
        assert eventually(lambda: not one.is_moving())
        process.send(signal.SIGCONT)
        # The first calls may still count for the jog that the guard has ended: the driver is about to see that.
        assert eventually(lambda: process.order("begin") or eventually(one.is_moving, 0.5))
    assert process.guards() == [guard]


def test_a_guard_at_work_answers_a_driver_that_thaws_and_finishes(driver, answer_stops):
    answer_stops(*[accept_and_go_on] * 10)  # it is at work for 5 s
    one, process = driver("jog")
    guard = process.watched()
    process.send(signal.SIGSTOP)
    assert eventually(lambda: one.requests("stop_program"))
    one.operate("refuse", port="command", duration_ms=60000)  # the driver finds no way to the arm, the guard has it
    process.send(signal.SIGCONT)
    time.sleep(1.5)  # the time in which a driver replaces a guard that does not answer
    assert one.is_moving() and process.guards() == [guard], "the driver replaced a guard at work"
    assert eventually(lambda: not one.is_moving())
    assert process.health()["replacements"] == 0
    one.operate("refuse", port="command", duration_ms=0)


def test_a_guard_that_was_frozen_together_with_its_driver_stops_the_arm_when_it_thaws(driver):
    one, process = driver("jog")
    guard = process.watched()
    process.send(signal.SIGSTOP)
    os.kill(guard, signal.SIGSTOP)
    time.sleep(1.0)  # far longer than a guard that is awake lets the arm move
    assert one.is_moving()
    os.kill(guard, signal.SIGCONT)
    assert eventually(lambda: not one.is_moving())


# ---- a controller with room for one client only ----

def test_a_frozen_driver_that_shuts_the_guard_out_is_ended(driver):
    one, process = driver("jog", single_client="refuse")
    froze_at = time.monotonic()
    process.send(signal.SIGSTOP)
    assert process.process.wait(WAIT) == -signal.SIGKILL
    assert time.monotonic() - froze_at < 10.0
    assert eventually(lambda: not one.is_moving())
    assert eventually(lambda: not process.guards())
    said = process.kill()
    assert "killing the driver" in said and "the arm is at rest" in said


def test_a_frozen_driver_is_ended_where_the_controller_listens_no_more(driver):
    one, process = driver("jog")
    one.operate("refuse", port="command", duration_ms=1500)
    process.send(signal.SIGSTOP)
    assert process.process.wait(WAIT) == -signal.SIGKILL
    assert eventually(lambda: not one.is_moving())


def test_a_driver_that_thaws_in_time_is_not_ended(driver):
    for _ in range(20):  # frozen for more than 0.5 s, by a test that gets no time itself, it would be ended rightly
        one, process = driver("jog", single_client="refuse")
        guard, froze_at = process.watched(), time.monotonic()
        process.send(signal.SIGSTOP)
        time.sleep(0.35)  # the guard finds it silent after 0.25 s
        process.send(signal.SIGCONT)
        if time.monotonic() - froze_at < 0.45:
            break
        process.kill()
    else:
        raise AssertionError("this computer cannot freeze a process for 0.35 s")
    time.sleep(0.5)  # what must not come has no other sign
    assert process.process.poll() is None and process.guards() == [guard]
    said = process.leave()
    assert "killing" not in said
    assert "is silent" not in said or "the driver is back" in said, said


def test_a_process_that_is_not_the_guards_parent_is_never_ended(driver):
    one, process = driver("jog", single_client="refuse")
    bystander = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(600)"])
    other = subprocess.Popen(guard_of(one, bystander.pid, "--moving"), stdin=subprocess.PIPE, stdout=subprocess.PIPE,
                             stderr=subprocess.PIPE, text=True, cwd=str(ROOT))
    try:
        said = next(line for line in other.stderr if "is not the driver any more" in line)  # where it would end it
        assert "process %d" % bystander.pid in said and bystander.poll() is None
        process.leave()  # and makes room
        other.communicate("q", timeout=WAIT)
        assert bystander.poll() is None
    finally:
        for child in (bystander, other):
            child.kill()
            child.wait()


# ---- a busy host ----

def test_a_starved_process_is_told_from_a_stopped_and_a_sleeping_one():
    busy = subprocess.Popen([sys.executable, "-c", "while True: pass"])
    asleep = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(600)"])
    try:
        assert eventually(lambda: waits_for_processor(busy.pid))
        assert eventually(lambda: not waits_for_processor(asleep.pid))
        busy.send_signal(signal.SIGSTOP)
        assert eventually(lambda: not waits_for_processor(busy.pid))
    finally:
        for process in (busy, asleep):
            process.kill()
            process.wait()
    assert not waits_for_processor(busy.pid)
