"""The log of every byte, against what a client sent and received."""
import json
import shutil
import sys
import time

import mcap.reader
import pytest
from raw_client import RawClient, RawFeed
from waiting import wait_until

from jaka_ros_driver.wire import log as wire_log
from jaka_ros_driver.wire.log import TrueJoints, WireEvent, WireLog, WireLogError, read_log

HOME = [0.0, 90.0, -90.0, 90.0, 90.0, 0.0]


def bytes_of(events, port, what):
    return b"".join(event.data for event in events if event.port == port and event.what == what)


def test_every_byte_with_its_time_and_the_joints(make_arm, tmp_path):
    path = str(tmp_path / "wire.mcap")
    arm = make_arm(log=path, time_scale=5.0)
    sent = (b'{"cmdName": "get_version"}', b"nan\xff\x00\n",
            b'{"cmdName":"joint_move","jointPosition":[5,90,-90,90,90,0],"speed":90}', b'{"cmdName":"wait_complete"}')
    received = []
    with RawClient(arm.command_port) as client, RawFeed(arm.status_port) as feed:
        for request in sent:
            client.send(request)
            received.append(client.reply())
        frames = [feed.raw_frame() for _ in range(5)]
    wait_until(lambda: not arm.operate("wire")["wire"]["connections"], "the clients to be gone")
    arm.close()
    entries = read_log(path)
    events = [entry for entry in entries if isinstance(entry, WireEvent)]
    assert bytes_of(events, "command", "in") == b"".join(sent)
    assert bytes_of(events, "command", "out") == b"".join(json.dumps(reply).encode() for reply in received)
    assert bytes_of(events, "status", "out").startswith(b"".join(frames))
    assert [event.what for event in events if event.port == "command"][0] == "open"
    assert [event.what for event in events if event.port == "command"][-1] == "close"
    joints = [entry for entry in entries if isinstance(entry, TrueJoints)]
    assert 0.0 <= joints[0].joint_position[0] < 0.01 and joints[-1].joint_position[0] == pytest.approx(0.0872664626)
    assert len(joints) > 5
    times = [entry.time_ns for entry in entries]
    assert times == sorted(times)


class HeldUp:
    """A socket whose owner does not get on for a while after each sending."""

    def __init__(self, link):
        self._link = link

    def __getattr__(self, name):
        return getattr(self._link, name)

    def send(self, data):
        taken = self._link.send(data)
        time.sleep(0.1)  # so long it is held up
        return taken


def test_an_answer_never_stands_before_what_it_answers_however_busy_the_host_is(make_arm, tmp_path):
    path = str(tmp_path / "wire.mcap")
    arm = make_arm(log=path)
    ends = []
    with RawClient(arm.command_port) as client, RawFeed(arm.status_port) as feed:
        size = len(feed.raw_frame())
        links = arm.server._sockets
        status = next(one for one in links if one.port == "status")
        links[status] = HeldUp(links[status])
        for _ in range(3):
            size += len(feed.raw_frame())
            ends.append(size)
            client.code("get_version")  # what a driver does that sees the arm stop
    arm.close()
    events = [event for event in read_log(path) if isinstance(event, WireEvent)]
    answered = [event.time_ns for event in events if event.port == "command" and event.what == "in"]
    assert len(answered) == len(ends) == 3
    for end, answer in zip(ends, answered):
        frames = iter([event for event in events if event.port == "status" and event.what == "out"])
        size = 0
        while size < end:
            frame = next(frames)
            size += len(frame.data)
        assert frame.time_ns <= answer


def test_a_working_day_is_told_by_its_log(make_arm, tmp_path, root):
    # Power, drives, moves, a stop in mid-move, a collision, a servo stream, the emergency stop: judged by the log. It
    # stays as build/working_day.mcap, to be looked at.
    path = str(tmp_path / "working_day.mcap")
    arm = make_arm(log=path, start="off", time_scale=10.0)
    with RawClient(arm.command_port) as client, RawFeed(arm.status_port) as feed:
        assert client.code("power_on") == "0"
        feed.until(lambda frame: frame["powered_on"] == 1)
        assert client.code("enable_robot") == "0"
        feed.until(lambda frame: frame["enabled"])
        assert client.code("joint_move", jointPosition=[30.0, *HOME[1:]], speed=60) == "0"
        assert client.code("wait_complete") == "0"
        pose = client.ask("get_tcp_pos")["tcp_pos"]
        assert client.code("moveL", cartPosition=[pose[0], pose[1], pose[2] - 50.0, *pose[3:]], speed=100) == "0"
        assert client.code("wait_complete") == "0"
        assert client.code("joint_move", jointPosition=[150.0, *HOME[1:]], speed=20) == "0"
        feed.until(lambda frame: frame["joint_actual_position"][0] > 35.0)
        assert client.code("stop_program") == "0"
        feed.until(lambda frame: frame["inpos"])
        assert client.code("joint_move", jointPosition=[150.0, *HOME[1:]], speed=20) == "0"
        feed.until(lambda frame: frame["joint_actual_position"][0] > 60.0)
        arm.operate("hit")
        feed.until(lambda frame: frame["protective_stop"])
        wait_until(lambda: not arm.state()["is_moving"], "standstill")
        assert client.code("clear_error") == "0"
        assert client.code("servo_move", relFlag=1) == "0"
        for _ in range(30):
            assert client.code("servo_j", relFlag=1, jointPosition=[0.2, 0, 0, 0, 0, 0]) == "0"
        arm.operate("press_emergency_stop")
        feed.until(lambda frame: frame["emergency_stop"])
    arm.close()
    (root / "build").mkdir(exist_ok=True)
    shutil.copy(path, str(root / "build"))
    entries = read_log(path)
    samples = [entry for entry in entries if isinstance(entry, TrueJoints)]

    def joint_1_at(what, request):
        asked = [entry for entry in entries if isinstance(entry, WireEvent) and entry.what == "in"
                 and entry.port == "command" and request in entry.data]
        return [min(samples, key=lambda sample, at=event.time_ns: abs(sample.time_ns - at)).joint_position[0]
                for event in asked] or pytest.fail("no %s in the log" % what)

    assert joint_1_at("power_on", b'"power_on"') == [0.0]
    stopped_at = joint_1_at("stop", b'"stop_program"')[0]
    moves = joint_1_at("moves", b'"joint_move"')
    assert 0.6 < stopped_at < 2.0 and moves[2] - stopped_at < 0.2  # it came to rest soon after
    assert max(abs(later.joint_position[0] - earlier.joint_position[0])
               for earlier, later in zip(samples, samples[1:])) < 0.5
    assert samples[-1].joint_position[0] < 2.5
    stops = [entry for entry in entries if isinstance(entry, WireEvent) and b'"emergency_stop": 1' in entry.data]
    assert stops and stops[0].port == "status"


def test_file_opens_elsewhere(make_arm, tmp_path):
    path = tmp_path / "wire.mcap"
    arm = make_arm(log=str(path))
    with RawClient(arm.command_port) as client:
        assert client.code("get_version") == "0"
    arm.close()
    with open(path, "rb") as file:
        reader = mcap.reader.make_reader(file, validate_crcs=True)
        summary = reader.get_summary()
        assert {channel.topic for channel in summary.channels.values()} == {
            "/wire/command", "/wire/status", "/wire/poll", "/wire/panel", "/joints"}
        assert {channel.message_encoding for channel in summary.channels.values()} == {"json"}
        assert {schema.encoding for schema in summary.schemas.values()} == {"jsonschema"}
        facts = {key: value for record in reader.iter_metadata() for key, value in record.metadata.items()}
        assert facts.pop("lost_messages") == "0"
        assert int(facts.pop("realtime_minus_monotonic_ns")) > 0 and not facts
        for _, channel, message in reader.iter_messages():
            assert "time_ns" in json.loads(message.data) and channel.topic


def test_log_is_on_disk_while_the_controller_runs(make_arm, tmp_path, monkeypatch):
    monkeypatch.setattr(wire_log, "FLUSH_INTERVAL_S", 0.05)
    path = str(tmp_path / "wire.mcap")
    arm = make_arm(log=path)
    with RawClient(arm.command_port) as client:
        assert client.code("get_version") == "0"
        wait_until(lambda: any(isinstance(entry, WireEvent) and entry.what == "out" for entry in read_log(path)),
                 "the reply in the unfinished file")


@pytest.fixture
def whole_log(make_arm, tmp_path):
    """Return the path of a finished log of a few dozen messages."""
    path = tmp_path / "wire.mcap"
    arm = make_arm(log=str(path))
    with RawClient(arm.command_port) as client:
        assert client.code("get_version") == "0"
    arm.close()
    return path


def test_truncated_log_is_read_as_far_as_it_goes_whatever_its_last_byte(whole_log):
    whole = whole_log.read_bytes()
    entries = read_log(str(whole_log))
    counts = []
    for size in [*range(min(len(whole), 1500)), *range(1500, len(whole), 37), len(whole) - 1]:
        whole_log.write_bytes(whole[:size])
        found = read_log(str(whole_log))
        assert found == [entry for entry in entries if entry in found]  # in the file two may stand the other way round
        counts.append(len(found))
    assert counts == sorted(counts) and counts[0] == 0 and counts[-1] == len(entries) > 0


def test_damaged_log_is_read_or_refused_whatever_byte_is_wrong(whole_log):
    whole = whole_log.read_bytes()
    refused = 0
    for place in [*range(min(len(whole), 1500)), *range(1500, len(whole), 37)]:
        for value in (0, 255, whole[place] ^ 1):
            whole_log.write_bytes(whole[:place] + bytes([value]) + whole[place + 1:])
            try:
                read_log(str(whole_log))
            except WireLogError as error:
                assert "wire.mcap" in str(error)
                refused += 1
    assert refused > 100


def test_what_cannot_be_written_or_read_is_told(tmp_path, make_arm):
    taken = tmp_path / "taken.mcap"
    taken.write_bytes(b"no log")
    with pytest.raises(WireLogError, match="taken"):
        WireLog(str(taken))
    with pytest.raises(WireLogError, match="taken"):
        read_log(str(taken))
    with pytest.raises(WireLogError):
        read_log(str(tmp_path / "missing.mcap"))
    with pytest.raises(WireLogError):
        make_arm(log=str(tmp_path / "no" / "such" / "folder.mcap"))
    assert taken.read_bytes() == b"no log"


def test_missing_package_is_told(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "mcap.writer", None)
    with pytest.raises(WireLogError, match="package mcap"):
        WireLog(str(tmp_path / "x.mcap"))
    assert not (tmp_path / "x.mcap").exists()


def test_full_disk_is_told_and_stops_nothing(tmp_path):
    log = WireLog(str(tmp_path / "x.mcap"))

    class FullDisk:
        def write(self, _data):
            raise OSError(28, "No space left on device")

        flush = tell = write
    log._writer._Writer__stream = FullDisk()
    for number in range(1000):
        log.bytes_in(number, "command", 1, b"x" * 1000)
    with pytest.raises(WireLogError, match="not complete"):
        log.close()
