"""Records of real controllers, played back: the probe finds what they hold, and invents nothing where they do not."""
import contextlib
import json
import socket
import threading
import time
from pathlib import Path

import pytest

from jaka_ros_driver.kinematics.arm_models import model_names
from jaka_ros_driver.probe import ask as questions
from jaka_ros_driver.probe import report
from jaka_ros_driver.probe.ask import QUESTIONS, Questioner, ask
from jaka_ros_driver.probe.facts import DESCRIBED, ProbeStage
from jaka_ros_driver.probe.look import KNOWN, OMITTED, look
from jaka_ros_driver.probe.recorded import ConnectionLog
from jaka_ros_driver.protocol.framing import ObjectStream

DATA = Path(__file__).resolve().parents[1] / "data"
RECORDS = {path.stem: json.loads(path.read_text(encoding="utf-8"))
           for path in sorted((DATA / "playback").glob("*.json"))}
OF_THE_PLAYER = {"polled_port", "frame_clock", "second_status_client", "second_client", "reply_time", "reply_time_p99",
                 "poll_rate", "feed_under_polling", "feed_longest_gap", "feed_period"}
"""Facts that this command makes up itself: whom it serves, and when."""
TABLES = {"frame_fields", "reply_types"}
"""Facts that tell of all that is in the record, whatever it is."""
OF_PART_OF_A_FRAME = {"frame_bytes", "frame_fields_missing"}
"""Facts that a frame does not hold of which only some fields are known."""
PATIENCE_S = 0.3


def frame_of(record):
    """Return the bytes of the record's frame; None where it has none."""
    if "frame_file" in record:
        return (DATA / "frames" / record["frame_file"]).read_bytes().strip()
    if "frame" not in record:
        return None
    text = ""
    for _ in range(3):
        text = json.dumps({"len": len(text), **record["frame"]})
    return text.encode()


class Player:
    """A controller that answers the requests of a record as it has them, and no other; it sends its frame.

    Args:
        record: The record.
        hangs_up: A request that is not in the record ends the connection; else it is not answered.
    """

    def __init__(self, record, hangs_up=False):
        self.record, self._hangs_up = record, hangs_up
        self._open = contextlib.ExitStack()
        self._ends = threading.Event()
        self.command_port = self._listen(self._answer)
        self.status_port = self._listen(self._feed)

    def _listen(self, serve):
        server = self._open.enter_context(socket.create_server(("127.0.0.1", 0)))

        def accept():
            with contextlib.suppress(OSError):
                while True:
                    connection, _ = server.accept()
                    threading.Thread(target=self._served, args=(serve, connection), daemon=True).start()
        self._open.callback(server.shutdown, socket.SHUT_RDWR)
        threading.Thread(target=accept, daemon=True).start()
        return server.getsockname()[1]

    def _served(self, serve, connection):
        with connection, contextlib.suppress(OSError):
            serve(connection)

    def _answer(self, connection):
        while not self._ends.is_set():
            data = connection.recv(65536)
            if not data:
                return
            items = list(ObjectStream().feed(data))  # what comes in another way than one whole request is not recorded
            name = items[0].get("cmdName") if len(items) == 1 and isinstance(items[0], dict) else None
            if name in self.record["replies"]:
                connection.sendall(json.dumps(self.record["replies"][name]).encode())
            elif self._hangs_up:
                return

    def _feed(self, connection):
        frame = frame_of(self.record)
        due = time.monotonic()
        while not self._ends.is_set():
            if frame:
                connection.sendall(frame)
            due += self.record.get("period", 0.1)
            self._ends.wait(max(0.0, due - time.monotonic()))

    def close(self):
        self._ends.set()
        self._open.close()


@pytest.fixture
def found(monkeypatch):
    """Return the facts of look and ask on a player of this record."""
    monkeypatch.setattr(Questioner.ask, "__defaults__", (PATIENCE_S,))
    monkeypatch.setattr(questions, "_SHORT_S", PATIENCE_S)
    monkeypatch.setattr(questions, "_POLLED_S", PATIENCE_S)  # what it finds then is the player's

    def found(record, hangs_up=False):
        facts, log = {}, ConnectionLog("127.0.0.1")
        with contextlib.closing(Player(record, hangs_up)) as player, contextlib.closing(log):
            feed = look(log, facts, player.status_port, 1, 2.0)
            ask(log, facts, player.command_port, feed, lambda line: None)
        return facts
    return found


def settled(facts, record):
    """Return the settled facts that are not those of the player."""
    known = OF_THE_PLAYER | TABLES | (OF_PART_OF_A_FRAME if "frame" in record else set())
    return {name: fact.value for name, fact in facts.items() if fact.value is not None and name not in known}


@pytest.mark.parametrize("name", RECORDS)
def test_what_a_record_holds_is_found_and_nothing_else(found, name):
    record = RECORDS[name]
    facts = found(record)
    assert settled(facts, record) == {key: value for key, value in record["facts"].items() if key != "feed_period"}
    if "feed_period" in record["facts"] and facts["feed_period"].value is not None:  # a busy host has no period
        assert facts["feed_period"].value == pytest.approx(record["facts"]["feed_period"], abs=0.01)
    assert all(facts[name].how for name in facts if facts[name].value is None), "what is open has its reason"
    asked = set(record["replies"]) & set(QUESTIONS)
    assert set(facts["reply_types"].value) == asked if asked else "reply_types" not in facts
    fields = facts["frame_fields"].value or {}
    assert set(fields) == set(json.loads(frame_of(record) or b"{}"))
    assert not fields or fields["joint_actual_position"][0] == "list of 6: number"


@pytest.mark.parametrize("name", RECORDS)
def test_where_it_hangs_up_less_is_found_and_nothing_wrong(found, name):
    record = RECORDS[name]
    facts = found(record, hangs_up=True)
    facts.pop("malformed", None)  # that this ends the connection is the player's
    assert not [name for name, value in settled(facts, record).items() if record["facts"].get(name) != value]


def test_a_fact_that_is_made_up_would_be_noticed(found):
    record = RECORDS["numbers_1.7"]
    other = {**record, "replies": {**record["replies"], "get_robot_state": {"enable": "x", "errorCode": 0}}}
    facts = settled(found(other), other)
    assert facts != record["facts"] and "error_code" not in facts, "texts and numbers are mixed: not settled"


@pytest.mark.parametrize("name", RECORDS)
def test_a_record_says_where_it_is_from_and_makes_a_report(name):
    record = RECORDS[name]
    assert len(record["source"]) > 60 and set(record["facts"]) <= set(DESCRIBED)
    assert set(record.get("frame", ())) <= KNOWN | OMITTED
    assert set(record["facts"].get("model", ())) <= set(model_names())
    content = report.as_json({key: report.Fact(value, name) for key, value in record["facts"].items()},
                             [ProbeStage.LOOK, ProbeStage.ASK], True)
    assert report.facts_of(content).keys() == record["facts"].keys()
