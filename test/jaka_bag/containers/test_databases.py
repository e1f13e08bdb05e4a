"""Storage files of rosbag2 as nobody's recorder makes them: a clear error or the messages that are there."""
import contextlib
import resource
import sqlite3
import struct
import time

import pytest
import yaml
from log_samples import START_NS, read, state_log
from sqlite_logs import write_database

from jaka_bag.cli.main import main
from jaka_bag.containers.interface import _Renumbering
from jaka_bag.containers.sqlite_recovery import SqliteRecovery
from jaka_bag.errors import BagFormatError
from jaka_bag.messages.batch import np

_TOPICS = """CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL,
    serialization_format TEXT NOT NULL, offered_qos_profiles TEXT NOT NULL);"""
_MESSAGES = "CREATE TABLE messages(id %s, topic_id INTEGER NOT NULL, timestamp INTEGER NOT NULL, data BLOB NOT NULL);"


def cdr(text):
    return b"\0\1\0\0" + struct.pack("<I", len(text) + 1) + text + b"\0"


def database_of(path, topics, rows, key="INTEGER PRIMARY KEY"):
    """Write a database of (id, topic) and (id, topic id, text), whatever they are."""
    database = sqlite3.connect(str(path))
    database.executescript(_TOPICS + _MESSAGES % key)
    database.executemany("INSERT INTO topics VALUES (?, ?, 'std_msgs/msg/String', 'cdr', '')", topics)
    database.executemany("INSERT INTO messages VALUES (?, ?, ?, ?)", [
        (number, topic, START_NS + i, cdr(text)) for i, (number, topic, text) in enumerate(rows)])
    database.commit()
    database.close()
    return path


def in_one_line(capsys, words, code=1):
    """Call a command that fails; return what it says on standard error, which is one line."""
    assert main([str(word) for word in words]) == code
    told = capsys.readouterr().err
    assert told.count("\n") == 1 and "Traceback" not in told
    return told


def test_a_row_of_a_negative_topic_costs_itself(tmp_path, capsys):
    path = database_of(tmp_path / "run.db3", [(1, "/a")], [(1, 1, b"one"), (2, -7, b"two"), (3, 1, b"three")])
    assert "a row is damaged (jaka_bag recover keeps the rest)" in in_one_line(capsys, ["info", path])
    assert main(["doctor", str(path)]) == 1
    assert "a row is no message" in capsys.readouterr().out
    assert main(["recover", str(path), str(tmp_path / "kept.mcap")]) == 1
    answer = capsys.readouterr()
    assert "PARTIAL" in answer.out and "a row is no message" in answer.err
    assert [sample.data for sample in read(tmp_path / "kept.mcap")] == [cdr(b"one"), cdr(b"three")]


def test_messages_of_a_negative_topic_are_not_given_to_another(tmp_path, capsys):
    path = database_of(tmp_path / "run.db3", [(-1, "/safety"), (1, "/chatter")], [(1, -1, b"SAFE"), (2, 1, b"CHAT")])
    assert main(["cat", str(path)]) == 1
    answer = capsys.readouterr()
    assert "SAFE" not in answer.out and "a row is damaged" in answer.err and answer.err.count("\n") == 1
    assert main(["doctor", str(path)]) == 1
    assert "the row of a topic is damaged" in capsys.readouterr().out
    assert main(["recover", str(path), str(tmp_path / "kept.mcap")]) == 1
    assert [(s.connection.topic, s.data) for s in read(tmp_path / "kept.mcap")] == [("/chatter", cdr(b"CHAT"))]


def test_a_negative_number_of_a_connection_is_no_place_in_a_table():
    with pytest.raises(BagFormatError, match="does not describe"):
        _Renumbering({0: 0, 1: 1})(np.array([0, -1], np.int64))


@pytest.mark.parametrize("key, rows, kept", [
    ("TEXT", [("1", 1, b"one"), ("x", 1, b"two")], []),
    ("TEXT", [(None, 1, b"one"), ("x", 1, b"two")], []),
    ("INTEGER", [(None, 1, b"one"), (2, 1, b"two")], [b"two"]),
    ("INTEGER", [(1, 1, b"one"), ("x", 1, b"two")], [b"one"]),
    ("INTEGER", [(1.5, 1, b"one"), (2, 1, b"two")], [b"two"])])
def test_rows_without_a_number_are_damaged(tmp_path, capsys, key, rows, kept):
    path = database_of(tmp_path / "run.db3", [(1, "/a")], rows, key)
    for command in ("info", "cat"):
        assert "a row is damaged" in in_one_line(capsys, [command, path])
    assert main(["doctor", str(path)]) == 1
    assert "a row is no message" in capsys.readouterr().out
    assert main(["recover", str(path), str(tmp_path / "kept.mcap")]) == 1
    told = capsys.readouterr().err
    assert "a row is no message" in told
    if kept:
        assert [sample.data for sample in read(tmp_path / "kept.mcap")] == [cdr(text) for text in kept]
    else:
        assert "no message could be read" in told and told.count("\n") == 1


def test_a_damaged_page_of_rows_whose_numbers_are_texts_costs_a_few_losses(tmp_path):
    path = database_of(tmp_path / "run.db3", [(1, "/a")], [("n%03d" % i, 1, b"x" * 400) for i in range(32)],
                       "TEXT PRIMARY KEY")
    with contextlib.closing(sqlite3.connect(str(path))) as database:
        (root,), (page,) = (database.execute(text).fetchone() for text in (
            "SELECT rootpage FROM sqlite_master WHERE name = 'messages'", "PRAGMA page_size"))
    raw = bytearray(path.read_bytes())
    last, = struct.unpack_from(">I", raw, (root - 1) * page + 8)  # the page below of the greatest numbers
    raw[(last - 1) * page:last * page] = b"\xff" * page
    path.write_bytes(bytes(raw))
    begun = time.process_time()
    with path.open("rb") as file:
        walk = SqliteRecovery(file.fileno(), len(raw))
        assert not sum(len(stretch.batch) for stretch in walk.stretches())
    assert 0 < len(walk.losses) < 50 and time.process_time() - begun < 5.0


def test_rows_of_negative_numbers_are_messages(tmp_path):
    path = database_of(tmp_path / "run.db3", [(1, "/a")], [(-5, 1, b"one"), (2, 1, b"two")])
    assert [sample.data for sample in read(path)] == [cdr(b"one"), cdr(b"two")]
    assert main(["recover", str(path), str(tmp_path / "kept.mcap"), "-q"]) == 0
    assert [sample.data for sample in read(tmp_path / "kept.mcap")] == [cdr(b"one"), cdr(b"two")]


_MADE_UP = {
    "virtual": "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id, timestamp, "
               "data BLOB AS (zeroblob(300000000)) VIRTUAL); INSERT INTO messages VALUES (1, 1, 1), (2, 1, 2);",
    "view": "CREATE VIEW messages AS SELECT 1 id, 1 topic_id, 1 timestamp, zeroblob(300000000) data;",
    "topics": "DROP TABLE topics; CREATE TABLE topics(id INTEGER PRIMARY KEY, name, serialization_format, "
              "offered_qos_profiles, type TEXT AS (hex(zeroblob(150000000))) VIRTUAL); "
              "INSERT INTO topics VALUES (1, '/a', 'cdr', ''); " + _MESSAGES % "INTEGER PRIMARY KEY"
              + "INSERT INTO messages VALUES (1, 1, 1, x'0001000000000000');",
    "virtual table": "CREATE VIRTUAL TABLE messages USING rtree(id, topic_id, timestamp, data, more);"}


@pytest.mark.parametrize("kind", sorted(_MADE_UP))
def test_a_database_that_makes_up_its_content_is_refused(tmp_path, capsys, kind):
    path = tmp_path / "run.db3"
    database = sqlite3.connect(str(path))
    try:
        database.executescript(_TOPICS + "INSERT INTO topics VALUES (1, '/a', 'std_msgs/msg/String', 'cdr', '');"
                               + _MADE_UP[kind])
    except sqlite3.OperationalError as error:
        pytest.skip("this sqlite3 makes none (%s)" % error)
    database.commit()
    database.close()
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    for words in (["info", path], ["cat", path], ["recover", path, tmp_path / "o.mcap"],
                  ["filter", path, tmp_path / "p.mcap", "-t", "/a"]):
        told = in_one_line(capsys, words)
        assert "no storage of rosbag2" in told or "generated" in told
    assert main(["doctor", str(path)]) == 1
    (tmp_path / "run").mkdir()
    path.rename(tmp_path / "run" / "run.db3")
    (tmp_path / "run" / "metadata.yaml").write_text(yaml.safe_dump({"rosbag2_bagfile_information": {
        "version": 5, "storage_identifier": "sqlite3", "relative_file_paths": ["run.db3"], "message_count": 2,
        "duration": {"nanoseconds": 1}, "starting_time": {"nanoseconds_since_epoch": 1}, "compression_format": "",
        "compression_mode": "", "topics_with_message_count": [{"message_count": 2, "topic_metadata": {
            "name": "/a", "type": "std_msgs/msg/String", "serialization_format": "cdr",
            "offered_qos_profiles": ""}}]}}))
    in_one_line(capsys, ["convert", tmp_path / "run", tmp_path / "o.bag"])
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 100 << 10


def test_definitions_and_versions_from_a_view_are_not_read(tmp_path):
    path = write_database(tmp_path / "run.db3", state_log(0.1))
    whole = [(sample.time, sample.data) for sample in read(path)]
    database = sqlite3.connect(str(path))
    database.executescript("DROP TABLE schema; DROP TABLE message_definitions; "
                           "CREATE VIEW schema AS SELECT hex(zeroblob(150000000)) schema_version; "
                           "CREATE VIEW message_definitions AS SELECT 'std_msgs/msg/String' topic_type, "
                           "'ros2msg' encoding, hex(zeroblob(150000000)) encoded_message_definition;")
    database.commit()
    database.close()
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    assert [(sample.time, sample.data) for sample in read(path)] == whole
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 100 << 10
