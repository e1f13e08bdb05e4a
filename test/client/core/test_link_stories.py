"""The links: made again at bounded pauses, closed on request, watched, and checked for their controller's identity."""
import json
import math

import pytest
from stories import HOME, Story

from jaka_ros_driver import commands as c
from jaka_ros_driver.client.core.actions import Actions, Close, Open, Port
from jaka_ros_driver.client.core.link import PortLink
from jaka_ros_driver.errors import ConnectionLost, InvalidCommand, StopCause
from jaka_ros_driver.protocol.framing import ObjectStream
from jaka_ros_driver.state import IoBank

MOVE = c.JointMove((1.0,) + HOME[1:], 1.0, 1.0)


def opens(story, port):
    return [at for at, action in story.asked_to_connect if action == Open(port)]


def closes(story):
    return [action.port for _, action in story.asked_to_connect if isinstance(action, Close)]


def test_a_controller_that_is_away_for_long_is_tried_twice_a_second():
    story = Story(ready=False)
    for _ in range(1000):
        if story.asked_to_connect[-1][0] == story.now:
            story.core.failed(Port.COMMAND, "refused", story.now)
            story.core.failed(Port.STATUS, "refused", story.now)
        story.run(0.008)
    tried = opens(story, Port.COMMAND)
    pauses = [b - a for a, b in zip(tried, tried[1:])]
    assert pauses[:3] == pytest.approx([0.1, 0.2, 0.4], abs=0.009)
    assert pauses[3:] == pytest.approx([0.5] * (len(pauses) - 3), abs=0.009) and len(pauses) > 10


def test_after_the_end_no_link_is_made_again():
    story = Story()
    story.core.close(story.now)
    story.core.disconnect(story.now)
    del story.asked_to_connect[:]
    for port in Port:
        story.core.failed(port, "refused", story.now)
    story.feed = False
    story.run(3.0)
    assert not [action for _, action in story.asked_to_connect if isinstance(action, Open)]


def test_nothing_that_is_called_for_after_the_shutdown_began_is_sent():
    story = Story()
    story.core.close(story.now)
    del story.sent[:]
    story.core.jog("jog", c.Jog(c.JogFrame.JOINT, 0, 0.3), story.now)
    story.core.servo_mode("servo", True, story.now)
    story.core.run("ask", story.core.ask(c.ClearError()), story.now)
    story.run(0.2)
    assert not {"jog", "servo_move", "clear_error"} & set(story.names())
    assert all(isinstance(story.error(call), ConnectionLost) for call in ("jog", "servo", "ask"))


def test_a_status_port_that_has_fallen_silent_is_made_anew():
    story = Story()
    story.feed = False
    story.run(0.75)
    assert Port.STATUS not in closes(story)
    story.run(0.2)
    assert closes(story) == [Port.STATUS] and len(opens(story, Port.STATUS)) == 2


def test_a_motion_ends_when_the_status_port_falls_silent_though_it_sends_bytes():
    story = Story()
    story.core.move("move", MOVE, True, story.now)
    story.run(0.3, move=1.0, inpos=False)
    story.feed = False
    for _ in range(130):
        story.core.received(Port.STATUS, b" ", story.now)
        story.run(0.008)
    assert story.cause("move") is StopCause.LINK_LOST and story.count("stop_program") == 1
    assert not closes(story)


def test_a_controller_that_is_not_the_simulated_one_that_was_meant_is_asked_who_it_is_and_left():
    story = Story(ready=False, simulator="twin")
    story.core.opened(Port.COMMAND, story.now)
    story.perform()
    assert story.names() == ["get_simulator_identity"] and closes(story) == [Port.COMMAND]
    assert not opens(story, Port.STATUS) and not story.core.links.is_ready


def test_a_state_never_serves_when_it_is_stale():
    story = Story()
    story.core.fresh_state(story.now)
    story.feed = False
    story.run(0.51)
    with pytest.raises(ConnectionLost):
        story.core.fresh_state(story.now)
    story.core.move("move", MOVE, True, story.now)
    story.perform()
    assert isinstance(story.error("move"), ConnectionLost) and story.count("joint_move") == 0


def test_a_move_beyond_the_limits_is_not_sent():
    story = Story()
    story.core.move("far", c.JointMove((0.0, 0.0, 3.2) + HOME[3:], 1.0, 1.0), True, story.now)
    story.core.move("fast", c.JointMove(HOME, 9.0, 1.0), True, story.now)
    story.core.jog("jog", c.Jog(c.JogFrame.JOINT, 0, 9.0), story.now)
    story.perform()
    assert all(isinstance(story.error(call), InvalidCommand) for call in ("far", "fast", "jog"))
    assert not {"joint_move", "jog"} & set(story.names())


@pytest.mark.parametrize("base", [0, 1])
def test_terminals_count_on_the_wire_from_where_the_parameter_says(base):
    story = Story(io_index_base=base)
    story.replies["get_digital_output"] = None
    story.core.run("read", story.core.ask(c.GetDigitalOutput(IoBank.CABINET, 4)), story.now)
    story.perform()
    assert story.sent[-1][1]["index"] == 4 + base


def test_damage_between_replies_costs_neither_of_them():
    story = Story()
    story.replies["clear_error"] = None
    for call in ("first", "second"):
        story.core.run(call, story.core.ask(c.ClearError()), story.now)
    story.perform()
    good = json.dumps({"cmdName": "clear_error", "errorCode": "0", "errorMsg": ""}).encode()
    story.core.received(Port.COMMAND, good + b"#damage#" + good, story.now)
    story.run(0.008)
    assert story.error("first") is None and story.error("second") is None


def test_nothing_but_the_question_who_it_is_leaves_on_a_link_that_is_not_confirmed():
    # A stop is owed, rest is seen, and the reply with the identity is missing: the open link is not usable yet.
    story = Story(ready=False, simulator="twin")
    story.extra["get_simulator_identity"] = {"identity": "twin"}
    story.core.opened(Port.COMMAND, story.now)
    story.perform()
    story.core.opened(Port.STATUS, story.now)
    story.run(0.2)
    story.core.move("move", MOVE, True, story.now)
    story.run(0.3, move=1.0, inpos=False)
    story.core.stop("stop", story.now)
    story.perform()
    story.core.closed(Port.STATUS, "closed by the controller", story.now)
    story.core.closed(Port.COMMAND, "closed by the controller", story.now)
    story.replies["get_simulator_identity"] = None
    story.core.opened(Port.COMMAND, story.now)
    story.perform()
    del story.sent[:]
    story.core.opened(Port.STATUS, story.now)  # an attempt of before comes about late
    story.run(0.5)
    story.core.stop("again", story.now)
    story.run(0.1)
    assert not story.sent and isinstance(story.error("again"), ConnectionLost)
    story.replies["get_simulator_identity"] = "0"
    story.reply("get_simulator_identity")
    story.run(0.3)
    assert story.names()[0] in ("servo_move", "get_version") and story.core.is_ready(story.now)


def test_a_flood_on_the_status_port_stops_what_moves_and_the_port_is_made_anew():
    story = Story()
    story.core.move("move", MOVE, True, story.now)
    story.run(0.3, move=1.0, inpos=False)
    story.feed = False
    for _ in range(5):
        story.core.received(Port.STATUS, b'{"len": 60000, ' * 4369, story.now)
        story.run(0.008)
    assert story.cause("move") is StopCause.LINK_LOST and story.count("stop_program") == 1
    assert closes(story) == [Port.STATUS] and "no status frames" in story.core.links.last_error


@pytest.mark.parametrize("unit", [b"{}", b"{", b"#", b'{"cmdName": "stop_program", "errorCode": "0"}'])
def test_a_flood_on_the_command_port_is_not_read_to_its_end_and_the_port_is_made_anew(unit, monkeypatch):
    story, read, feed = Story(), [], ObjectStream.feed
    monkeypatch.setattr(ObjectStream, "feed", lambda stream, data: read.append(len(data)) or feed(stream, data))
    story.core.received(Port.COMMAND, unit * ((1 << 20) // len(unit)), story.now)
    assert 0 < sum(read) < 1 << 19
    story.perform()
    assert closes(story) == [Port.COMMAND] and not story.core.links.is_ready
    assert "answers" in story.core.links.last_error


def test_replies_without_end_that_are_asked_for_are_no_flood():
    story = Story()
    for number in range(3000):
        story.core.run(number, story.core.ask(c.ClearError()), story.now)
        story.perform()
    assert not closes(story)


class Rival:
    """A second client, which takes the command port ``after`` s on each connection of the driver."""

    def __init__(self, story, after=0.4):
        self.story, self.after = story, after
        self.seen, self.opened_at = len(story.asked_to_connect), story.now

    def run(self, seconds, times=10 ** 6, **running):
        story = self.story
        for _ in range(int(seconds / 0.008)):
            story.run(0.008, **running)
            new, self.seen = story.asked_to_connect[self.seen:], len(story.asked_to_connect)
            if any(action == Open(Port.COMMAND) for _, action in new):
                story.core.opened(Port.COMMAND, story.now)
                story.perform()
                self.opened_at = story.now
            if self.opened_at is not None and story.now - self.opened_at >= self.after and times:
                times -= 1
                self.opened_at = None
                story.core.closed(Port.COMMAND, "closed by the controller", story.now)
                story.perform()
        return self


@pytest.mark.parametrize("after", [0.0, 0.4, 2.5])
def test_a_driver_whose_port_is_taken_three_times_gives_way_and_says_so(after):
    story = Story()
    rival = Rival(story, after)
    while not any("giving way" in text for text in story.log):
        rival.run(0.008)
        assert story.now < 110.0
    given_way_at = story.now
    assert "another client" in story.core.links.last_error and "another client" in story.core.links.health().last_error
    story.core.move("move", MOVE, True, story.now)
    story.core.run("ask", story.core.ask(c.ClearError()), story.now)
    story.perform()
    assert all("another client" in str(story.error(call)) for call in ("move", "ask"))
    del story.asked_to_connect[:]
    rival.seen = 0
    rival.run(60.0)
    tried = opens(story, Port.COMMAND)
    assert tried[0] - given_way_at == pytest.approx(1.0, abs=0.05)
    pauses = [b - a - after for a, b in zip(tried, tried[1:])]
    assert pauses == pytest.approx(([2.0, 4.0, 8.0] + [10.0] * 9)[:len(pauses)], abs=0.05) and len(pauses) >= 5
    assert sum("giving way" in text for text in story.log) == 1


def test_two_drivers_of_one_controller_give_way_to_each_other_and_each_says_that_there_is_another():
    drivers = [Story(), Story()]
    drivers[1].core.closed(Port.COMMAND, "closed by the controller", drivers[1].now)
    seen = [len(driver.asked_to_connect) for driver in drivers]
    said_at, connected = {}, []
    while drivers[0].now < 160.0:
        for number, driver in enumerate(drivers):
            driver.run(0.008)
            new, seen[number] = driver.asked_to_connect[seen[number]:], len(driver.asked_to_connect)
            if any(action == Open(Port.COMMAND) for _, action in new):  # the port is the last one's that connects
                connected.append(driver.now)
                driver.core.opened(Port.COMMAND, driver.now)
                driver.perform()
                other = drivers[1 - number]
                other.core.closed(Port.COMMAND, "closed by the controller", other.now)
                other.perform()
            if "another client" in driver.core.links.health().last_error:
                said_at.setdefault(number, driver.now)
    assert len(said_at) == 2 and max(said_at.values()) < 103.0
    pauses = [b - a for a, b in zip(connected, connected[1:]) if b >= max(said_at.values())]
    assert pauses[1:] == pytest.approx([2.0, 2.0, 4.0, 4.0, 8.0, 8.0, 10.0, 10.0], abs=0.05)


def test_a_controller_that_still_holds_a_connection_which_the_driver_has_dropped_is_no_other_client():
    # it serves its first client only, and ends each new one until it knows that the first has left
    story = Story()
    rival = Rival(story, 0.0)
    rival.opened_at = None
    story.replies["is_in_servomove"] = None
    while Port.COMMAND not in closes(story):
        rival.run(0.008)
        assert story.now < 103.0
    story.replies.update(dict.fromkeys(("get_version", "set_port10000_delay_ms"), None))
    rival.run(20.0)
    tried = opens(story, Port.COMMAND)[-20:]
    assert len(tried) == 20 and max([b - a for a, b in zip(tried, tried[1:])]) < 0.6
    assert not any("giving way" in text or "another client" in text for text in story.log)


def test_who_owes_a_stop_takes_the_port_for_it_from_whomever():
    story = Story()
    rival = Rival(story, 0.4).run(8.0)
    assert any("giving way" in text for text in story.log)
    rival.after = 1e9
    rival.run(12.0)
    assert story.core.links.is_ready
    story.core.move("move", MOVE, True, story.now)
    story.run(0.3, move=1.0, inpos=False)
    del story.sent[:]
    taken_at, rival.after = story.now, 0.0
    rival.run(0.1, times=1, move=1.0, inpos=False)
    rival.after = 1e9
    rival.run(0.9, inpos=False)
    stop = next(at for at, request in story.sent if request["cmdName"] == "stop_program")
    assert stop - taken_at < 0.3 and story.names()[:2] == ["servo_move", "stop_program"]


@pytest.mark.parametrize("comes_back", [True, False])
def test_a_stop_takes_the_port_at_once_that_was_left_to_another_client(comes_back):
    story = Story()
    rival = Rival(story, 0.4)
    while not any("giving way" in text for text in story.log):
        rival.run(0.008)
    rival.run(0.1)
    rival.after = 1e9
    assert not story.core.links.is_ready and story.error("stop") == "pending"
    asked_at = story.now
    story.core.stop("stop", story.now)
    (rival if comes_back else story).run(1.0)
    assert opens(story, Port.COMMAND)[-1] - asked_at < 0.02
    if comes_back:
        assert story.error("stop") is None and story.answers["stop"][0] - asked_at < 0.3
    else:
        assert isinstance(story.error("stop"), ConnectionLost) and 0.8 < story.answers["stop"][0] - asked_at < 0.95


def test_a_stop_takes_the_port_at_once_also_while_a_motion_that_was_stopped_is_watched():
    story = Story()
    rival = Rival(story, 0.4).run(8.0)
    rival.after = 1e9
    rival.run(12.0)
    story.core.move("move", MOVE, True, story.now)
    story.run(0.3, move=1.0, inpos=False)
    story.core.stop("first", story.now)
    rival.after = 0.0
    rival.run(0.1, times=1, move=1.0, inpos=False)
    assert story.error("first") is None and not story.core.is_free and not story.core.links.is_ready
    rival.after = 1e9
    del story.sent[:]
    asked_at = story.now
    story.core.stop("second", story.now)
    rival.run(0.1, inpos=False)
    assert story.error("second") is None and story.answers["second"][0] - asked_at < 0.05
    assert "stop_program" in story.names()


@pytest.mark.parametrize("is_in_custody", [True, False])
def test_a_stop_that_waits_for_its_port_is_answered_when_the_driver_ends(is_in_custody):
    story = Story()
    rival = Rival(story, 0.4).run(8.0)
    rival.after = 1e9
    rival.run(12.0)
    if is_in_custody:
        story.core.move("move", MOVE, True, story.now)
        story.run(0.3, move=1.0, inpos=False)
        story.core.stop("first", story.now)
    rival.after = 0.0
    rival.run(0.1, times=1, move=1.0, inpos=False)
    assert story.core.is_free is not is_in_custody and not story.core.links.is_ready
    story.core.stop("stop", story.now)
    story.perform()
    assert story.error("stop") == "pending"
    story.core.close(story.now)
    story.perform()
    assert isinstance(story.error("stop"), ConnectionLost)


def test_a_port_that_nobody_takes_any_more_is_a_port_like_any_other():
    story = Story()
    rival = Rival(story).run(20.0)
    rival.after = 1e9
    rival.run(45.0)
    assert story.core.links.is_ready and not story.core.links.last_error
    rival.after = 0.0
    rival.run(2.0, times=1)
    assert story.core.links.is_ready


@pytest.mark.parametrize("kind", ["guard", "dark", "seldom"])
def test_ports_that_are_lost_otherwise_are_taken_back_at_once(kind):
    story = Story()
    rival = Rival(story, 1e9)
    for _ in range(5):
        rival.run(4.5 if kind == "seldom" else 1.5)
        if kind == "guard":  # the process stood still, and the guard took the port
            story.now += 0.4
        if kind == "dark":
            story.feed = False
            rival.run(0.6)
        story.core.closed(Port.COMMAND, "closed by the controller", story.now)
        story.perform()
        story.feed = True
        rival.run(1.0)
        assert story.core.links.is_ready
    assert not any("giving way" in text for text in story.log)


def test_what_is_no_reply_is_counted():
    story = Story()
    for count in range(1, 4):
        story.core.received(Port.COMMAND, b'{"cmdName" nothing}', story.now)
        assert story.core.links.health().damaged_replies == count


class Mute(dict):
    """Replies of a controller that answers nothing."""

    def get(self, name, default=None):
        return None


@pytest.mark.parametrize("count, is_flooded", [(1000, False), (1001, True)])
def test_a_thousand_replies_that_nobody_asked_for_are_read_on_a_new_connection(count, is_flooded):
    story = Story()
    story.core.received(Port.COMMAND, b'{"cmdName": "no", "errorCode": "0"}' * 1000, story.now)
    story.core.closed(Port.COMMAND, "closed by the controller", story.now)
    story.perform()
    story.replies = Mute()
    before = len(opens(story, Port.COMMAND))
    while len(opens(story, Port.COMMAND)) == before:
        story.run(0.008)
    story.core.opened(Port.COMMAND, story.now)
    story.core.received(Port.COMMAND, b'{"cmdName": "no", "errorCode": "0"}' * count, story.now)
    story.perform()
    assert bool(closes(story)) is is_flooded


@pytest.mark.parametrize("strays_kib, is_read", [(120, True), (133, False)])
def test_of_a_hundred_and_twenty_eight_kibibytes_that_answer_nothing_no_more_is_read(strays_kib, is_read):
    story = Story()
    story.replies = Mute()
    story.core.run("call", story.core.ask(c.Query.VERSION), story.now)
    story.perform()
    stray = b'{"cmdName": "no", "errorCode": "0", "errorMsg": ""}'
    reply = b'{"cmdName": "get_version", "errorCode": "0", "errorMsg": "", "version": "1"}'
    stray = stray.replace(b'""', b'"%s"' % (b"x" * (1024 - len(stray))))
    story.core.received(Port.COMMAND, stray * strays_kib + reply, story.now)
    story.perform()
    assert (story.error("call") is None) is is_read and bool(closes(story)) is not is_read


def test_a_connection_that_ends_within_two_seconds_is_made_again_after_longer_and_longer_pauses():
    link, now, pauses = PortLink(Port.STATUS, Actions()), 100.0, []
    link.start(now)
    for lasted in (1.5, 1.5, 1.5, 2.5):
        link.opened(now)
        now += lasted
        link.lost("closed by the controller", now)
        pauses.append(link.retry_at - now)
        now = link.retry_at
    assert pauses == pytest.approx([0.1, 0.2, 0.4, 0.1])


def test_a_link_that_was_stopped_can_be_started_again_and_is_kept_up_then():
    link = PortLink(Port.STATUS, Actions())
    link.start(100.0)
    link.opened(100.0)
    link.stop("it is not known whose it is")
    assert link.retry_at == math.inf and not link.is_up
    link.start(101.0)
    link.failed("refused", 101.1)
    assert 101.1 < link.retry_at < 102.0


def test_a_move_waits_two_seconds_for_an_arm_that_somebody_else_moves():
    story = Story()
    story.run(0.2, move=10.0)
    story.core.move("move", c.JointMove((1.0,) + HOME[1:], 1.0, 1.0), True, story.now)
    story.run(2.2, move=10.0)
    assert story.error("move") == "pending" and story.count("joint_move") == 0
    story.run(0.3, move=10.0)
    assert isinstance(story.error("move"), InvalidCommand) and story.count("joint_move") == 0


@pytest.mark.parametrize("is_up", [False, True])
def test_the_feed_of_a_controller_that_is_not_identified_any_more_is_closed_also_while_it_connects(is_up):
    story = Story(ready=False, simulator="twin")
    story.extra["get_simulator_identity"] = {"identity": "twin"}
    story.core.opened(Port.COMMAND, story.now)
    story.perform()
    story.core.tick(story.now)
    story.perform()
    assert len(opens(story, Port.STATUS)) == 1
    if is_up:
        story.core.opened(Port.STATUS, story.now)
    story.core.closed(Port.COMMAND, "cut", story.now)
    story.perform()
    assert closes(story) == [Port.STATUS]
    story.feed = False
    story.extra["get_simulator_identity"] = {"identity": "another"}
    story.run(0.6)
    story.core.opened(Port.COMMAND, story.now)
    story.perform()
    story.run(0.6)
    assert len(opens(story, Port.STATUS)) == 1 and story.core.state is None
