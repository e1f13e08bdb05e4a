"""The core's invariants, each with a defect planted into a good core: it is noticed."""
import pytest
from stories import HOME, Story

from jaka_ros_driver import commands as c
from jaka_ros_driver.client.core.invariants import check_invariants
from jaka_ros_driver.client.core.motion import MotionOwner
from jaka_ros_driver.client.core.phases import Phase
from jaka_ros_driver.client.core.procedures.steps import Running, pause
from jaka_ros_driver.client.core.requests.admission import ArmRequest
from jaka_ros_driver.errors import MotionInterrupted, StopCause

NEVER = float("inf")


class Answered:
    is_answered = True


def free():
    return Story()


def without_link():
    return Story(ready=False)


def asked_for():
    """Return a story whose move is under way."""
    story = Story()
    story.core.move("move", c.JointMove((0.5,) + HOME[1:], 0.5, 1.0), False, story.now)
    story.perform()
    story.run(0.1, move=0.5)
    assert story.core.custody._phase is Phase.HELD
    return story


def settling():
    story = Story()
    story.replies["joint_move"] = "7"
    story.core.move("move", c.JointMove((0.5,) + HOME[1:], 0.5, 1.0), False, story.now)
    story.perform()
    assert story.core.custody._phase is Phase.SETTLING
    return story


def stopping():
    """Return a story whose move is being stopped, with its accepted stop still to be answered by the arm."""
    story = asked_for()
    story.core.stop("stop", story.now)
    story.perform()
    assert story.core.custody._phase is Phase.STOPPING and not story.core.custody.must_stop
    return story


def owed():
    """Return a story whose move is being stopped, and the controller keeps silent."""
    story = asked_for()
    story.replies["stop_program"] = None
    story.core.stop("stop", story.now)
    story.perform()
    assert story.core.custody.must_stop
    return story


def of_custody(**fields):
    def plant(story):
        for name, value in fields.items():
            assert hasattr(story.core.custody, name)
            setattr(story.core.custody, name, value)
    return plant


def wait(*calls, deadline=200.0):
    def plant(story):
        requests = [ArmRequest(call, story.core._admission, story.now) for call in calls]
        for request in requests:
            request.deadline = deadline
        story.core._admission._waiting = requests
    return plant


def no_deadline(story):
    wait("call", deadline=NEVER)(story)
    story.core.next_deadline = lambda: NEVER


def run_ended_procedure(story):
    running = Running(iter(()), None, lambda *_: None)
    running.has_ended = True
    story.core._running.append(running)


def run_late_procedure(story):
    def procedure():
        yield pause(1.0)
    running = Running(procedure(), None, lambda *_: None)
    running.begin(story.now - 2.0)
    story.core._running.append(running)


def trust_twice(story):
    story.core.channel.introduction = object()


def lose_confirmation(story):
    story.core.links.is_ready = True


def leave_replies(story):
    story.core.channel._exchange.sent("get_version", story.now, 1.0)


def change_without_end(story):
    story.core._admission.busy_with = MotionOwner.SETTING


def forget_free_stop(story):
    story.core._admission.stops_under_way = 1


def lose_deadline(story):
    story.core.next_deadline = lambda: float("nan")


OUTCOME = MotionInterrupted(StopCause.FAULT)
PLANTED = [
    (free, of_custody(motion=object()), "custody is free, and its motion is"),
    (asked_for, of_custody(motion=None), "custody is held, and its motion is None"),
    (free, lambda story: story.told.append(True), "custody is free, and the guard was notified that the arm moves"),
    (asked_for, lambda story: story.told.append(False), "the guard was notified that the arm rests"),
    (free, of_custody(_retry_at=1.0), "a stop is due again, and nothing is being stopped"),
    (asked_for, of_custody(_retry_at=1.0), "a stop is due again, and nothing is being stopped"),
    (asked_for, of_custody(_outcome=OUTCOME), "nothing is being stopped, and an outcome"),
    (asked_for, of_custody(_accepted_at=1.0), "nothing is being stopped, and an outcome"),
    (asked_for, of_custody(_outstanding=1), "nothing is being stopped, and an outcome"),
    (asked_for, of_custody(_is_answered=True), "running motion were answered with its end"),
    (settling, of_custody(_is_answered=False), "that was refused wait still"),
    (owed, of_custody(_outstanding=0), "a stop is owed, the link is up, no reply is outstanding"),
    (stopping, of_custody(_accepted_at=1.0), "a stop was accepted -"),
    (stopping, of_custody(_accepted_at=1e6), "a stop was accepted"),
    (stopping, of_custody(_is_answered=False), "the callers of the motion wait still"),
    (owed, of_custody(_is_answered=False, _began_at=NEVER), "may never get an answer"),
    (owed, of_custody(_outstanding=-1), "-1 replies to stops are outstanding"),
    (free, trust_twice, "a link is trusted whose controller is still being asked"),
    (without_link, lose_confirmation, "the driver is ready on a link that is not confirmed"),
    (without_link, leave_replies, "replies are waited for on a link that is not open"),
    (free, wait("call", "call"), "a call waits twice"),
    (free, wait(Answered()), "a call that was answered waits still"),
    (free, no_deadline, "calls wait, and nothing is due"),
    (free, change_without_end, "a change is running, and nothing carries it out"),
    (free, forget_free_stop, "1 stops of a free arm are running"),
    (free, lose_deadline, "the next deadline is no number"),
    (asked_for, lambda story: setattr(story.core.custody.motion, "deadline", story.now - 1e-3),
     "after a tick custody is due still, since 0.0010 s"),
    (owed, of_custody(_retry_at=1.0, _outstanding=0), "after a tick custody is due still"),
    (free, wait("call", deadline=1.0), "after a tick a call that waits is due still"),
    (free, lambda story: setattr(story.core.links, "_next_beat", 1.0), "after a tick a link is due still"),
    (free, wait("call"), "waits, and it is known whether it may begin"),
    (asked_for, wait("call"), "waits, and it is known whether it may begin"),
    (free, run_late_procedure, "after a tick a procedure is due still, since 1.0000 s"),
    (free, run_ended_procedure, "a procedure that has ended is kept"),
]


def check(story):
    check_invariants(story.core, bool(story.told) and story.told[-1], story.now, has_ticked=True)


@pytest.mark.parametrize("make", [free, without_link, asked_for, settling, stopping, owed])
def test_a_good_core_keeps_them(make):
    story = make()
    story.core.tick(story.now)
    story.perform()
    check(story)


@pytest.mark.parametrize("make, plant, text", PLANTED, ids=["%s, %s" % (make.__name__, text)
                                                            for make, _, text in PLANTED])
def test_what_is_planted_is_noticed(make, plant, text):
    story = make()
    story.core.tick(story.now)
    story.perform()
    plant(story)
    with pytest.raises(AssertionError) as broken:
        check(story)
    assert text in str(broken.value)


def test_a_retry_that_waits_for_replies_is_due_with_the_last_of_them():
    story = owed()
    of_custody(_retry_at=1.0)(story)
    check(story)
