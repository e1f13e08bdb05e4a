"""``doctor`` and ``recover`` of rosbag2 folders whose files, or ``metadata.yaml``, are damaged or not there."""
import json
import shutil
import sqlite3
import tempfile
from pathlib import Path

import pytest
import yaml
from log_samples import read, state_log, write
from sqlite_logs import write_database

from jaka_bag.cli.main import main
from jaka_bag.containers import rosbag2_folder, rosbag2_reader
from jaka_bag.containers.compression import unpack_file
from jaka_bag.containers.index import storage_files
from jaka_bag.containers.registry import open_log

rosbag2 = pytest.importorskip("rosbags.rosbag2")
if not hasattr(rosbag2, "StoragePlugin"):
    pytest.skip("this rosbags writes no sqlite3 of these types", allow_module_level=True)
SQLITE3, MCAP = rosbag2.StoragePlugin.SQLITE3, rosbag2.StoragePlugin.MCAP


def content(folder):
    """Return what rosbags reads of a folder: (topic, type, time, CDR) in the order of time."""
    with rosbag2.Reader(folder) as reader:
        return sorted((c.topic, c.msgtype, time, bytes(raw)) for c, time, raw in reader.messages())


def by_rosbags(source, folder, storage, mode=None):
    """Have rosbags write the messages of a folder into another one, of the storage and the mode of compression."""
    writer = rosbag2.Writer(folder, version=9, storage_plugin=storage)
    if mode:
        writer.set_compression(rosbag2.CompressionMode[mode], rosbag2.CompressionFormat.ZSTD)
    with rosbag2.Reader(source) as reader, writer:
        new = {c.id: writer.add_connection(c.topic, c.msgtype, msgdef=c.msgdef.data, rihs01=c.digest,
                                           offered_qos_profiles=c.ext.offered_qos_profiles)
               for c in reader.connections}
        for connection, log_time, raw in reader.messages():
            writer.write(new[connection.id], log_time, raw)
    return folder


@pytest.fixture(scope="module")
def plain(tmp_path_factory):
    place = tmp_path_factory.mktemp("plain")
    source = write(place / "source.bag", state_log(8.0))
    assert main(["convert", str(source), str(place / "run"), "--profile", "ros2", "-q"]) == 0
    return place / "run"


def test_whole_folders_of_every_storage(plain, tmp_path, capsys):
    expected = content(plain)
    for name, storage, mode in (("mcap", MCAP, None), ("mcap_file", MCAP, "FILE"), ("sql", SQLITE3, None),
                                ("sql_file", SQLITE3, "FILE"), ("sql_message", SQLITE3, "MESSAGE")):
        folder = by_rosbags(plain, tmp_path / name, storage, mode)
        assert main(["doctor", str(folder)]) == 0
        assert "whole: %d messages" % len(expected) in capsys.readouterr().out
        with open_log(folder) as reader:
            assert not reader.index.notes
        (folder / "metadata.yaml").unlink()
        assert main(["info", str(folder)]) == 1
        assert "jaka_bag recover makes one" in capsys.readouterr().err
        assert main(["doctor", str(folder)]) == 1
        out = capsys.readouterr().out
        assert "error: there is no metadata.yaml" in out and "keeps the %d messages" % len(expected) in out
        assert main(["recover", str(folder), "-q"]) == 0
        assert content(tmp_path / (name + "_recovered")) == expected
        assert main(["doctor", str(tmp_path / (name + "_recovered"))]) == 0


def two_files(plain, folder, suffix):
    """Split a folder's messages by time into files ``_9`` and ``_10`` under one ``metadata.yaml``."""
    messages = content(plain)
    middle = sorted(time for _, _, time, _ in messages)[len(messages) // 2]
    folder.mkdir()
    facts = None
    for number, span in ((9, lambda time: time < middle), (10, lambda time: time >= middle)):
        part = folder.parent / ("%s_part_%d" % (folder.name, number))
        with rosbag2.Reader(plain) as reader, rosbag2.Writer(
                part, version=9, storage_plugin=SQLITE3 if suffix == ".db3" else MCAP) as writer:
            sources = list(reader.connections)
            sources = sources if number == 9 else sources[::-1]  # its numbers of topics are others
            new = {c.id: writer.add_connection(c.topic, c.msgtype, msgdef=c.msgdef.data, rihs01=c.digest,
                                               offered_qos_profiles=c.ext.offered_qos_profiles) for c in sources}
            for connection, log_time, raw in reader.messages():
                if span(log_time):
                    writer.write(new[connection.id], log_time, raw)
        name = "run_%d%s" % (number, suffix)
        shutil.move(str(part / (part.name + suffix)), str(folder / name))
        facts = facts or yaml.safe_load((part / "metadata.yaml").read_text())
        facts["rosbag2_bagfile_information"].setdefault("names", []).append(name)
    information = facts["rosbag2_bagfile_information"]
    information["relative_file_paths"] = information.pop("names")
    information["message_count"] = len(messages)
    for topic in information["topics_with_message_count"]:
        topic["message_count"] = sum(m[0] == topic["topic_metadata"]["name"] for m in messages)
    (folder / "metadata.yaml").write_text(yaml.safe_dump(facts))
    return folder, messages, middle


@pytest.mark.parametrize("suffix", [".db3", ".mcap"])
def test_several_files(plain, tmp_path, capsys, suffix):
    folder, messages, middle = two_files(plain, tmp_path / "run", suffix)
    assert main(["doctor", str(folder)]) == 0
    capsys.readouterr()
    assert main(["recover", str(folder), str(tmp_path / "all"), "-q"]) == 0
    assert content(tmp_path / "all") == messages
    (folder / "metadata.yaml").write_text("a: [")  # without it they are taken by their numbers
    assert main(["recover", str(folder), str(tmp_path / "numbered"), "-q"]) == 0
    with rosbag2.Reader(tmp_path / "numbered") as reader:
        times = [time for _, time, _ in reader.messages()]
    assert times == sorted(times) and content(tmp_path / "numbered") == messages
    last = folder / ("run_10" + suffix)
    last.write_bytes(b"")
    assert main(["doctor", str(folder)]) == 1
    capsys.readouterr()
    assert main(["recover", str(folder), str(tmp_path / "first"), "--json"]) == 1
    lost = json.loads(capsys.readouterr().out)["losses"]
    assert [loss["file"] for loss in lost] == ["run_10" + suffix]
    assert content(tmp_path / "first") == [m for m in messages if m[2] < middle]


def test_files_are_ordered_by_their_numbers_whatever_else_is_in_their_names(tmp_path):
    names = ["run_9.mcap", "run_10.mcap", "run_10²_1.mcap", "x٣.mcap"]
    for name in names:
        (tmp_path / name).write_bytes(b"")
    assert storage_files(tmp_path) == names


def test_a_file_that_is_named_and_not_there(plain, tmp_path, capsys):
    folder, messages, middle = two_files(plain, tmp_path / "run", ".mcap")
    (folder / "run_9.mcap").unlink()
    assert main(["doctor", str(folder)]) == 1
    out = capsys.readouterr().out
    assert "run_9.mcap" in out and "it is not there" in out
    assert "metadata.yaml tells of %d messages" % len(messages) in out
    assert main(["recover", str(folder), str(tmp_path / "o")]) == 1
    assert "metadata.yaml names it, and it is not there" in capsys.readouterr().err
    assert content(tmp_path / "o") == [m for m in messages if m[2] >= middle]


def test_what_metadata_declares_is_not_believed(plain, tmp_path, capsys):
    folder = tmp_path / "run"
    shutil.copytree(str(plain), str(folder))
    text = (folder / "metadata.yaml").read_text()
    facts = yaml.safe_load(text)
    topic = facts["rosbag2_bagfile_information"]["topics_with_message_count"][0]
    topic["message_count"] += 1
    (folder / "metadata.yaml").write_text(yaml.safe_dump(facts))
    assert main(["doctor", str(folder)]) == 1
    assert "%s: metadata.yaml tells of %d messages, the files hold %d" % (
        topic["topic_metadata"]["name"], topic["message_count"], topic["message_count"] - 1) in capsys.readouterr().out


@pytest.mark.parametrize("suffix", [".db3", ".mcap"])
def test_a_file_that_is_there_and_not_named_is_not_left_out(plain, tmp_path, capsys, suffix):
    folder, messages, _ = two_files(plain, tmp_path / "run", suffix)
    facts = yaml.safe_load((folder / "metadata.yaml").read_text())
    facts["rosbag2_bagfile_information"]["relative_file_paths"].pop()
    (folder / "metadata.yaml").write_text(yaml.safe_dump(facts))
    for words in (["convert", folder, tmp_path / "o.bag"], ["cat", folder], ["info", "--freq", folder]):
        assert main([str(word) for word in words]) == 1
        told = capsys.readouterr()
        assert "run_10%s is not named by metadata.yaml (jaka_bag recover takes it up)" % suffix in told.err
        assert told.err.count("\n") == 1 and not told.out
    assert main(["info", str(folder)]) == 0
    assert "run_10%s is not named by metadata.yaml" % suffix in capsys.readouterr().out
    assert main(["recover", str(folder), str(tmp_path / "all"), "-q"]) == 0
    assert content(tmp_path / "all") == messages


@pytest.mark.parametrize("storage", [SQLITE3, MCAP])
def test_a_file_that_rosbag2_has_unpacked_in_place_is_no_second_one(plain, tmp_path, capsys, storage):
    folder = by_rosbags(plain, tmp_path / "run", storage, "FILE")
    (packed,) = folder.glob("*.zstd")
    with open(packed, "rb") as file, open(packed.with_suffix(""), "wb") as unpacked:
        unpack_file(file.fileno(), packed.stat().st_size, unpacked)
    with open_log(folder) as reader:
        assert not reader.index.notes
    assert main(["doctor", str(folder)]) == 0
    assert "whole: %d messages" % len(content(plain)) in capsys.readouterr().out
    (folder / "metadata.yaml").unlink()
    assert main(["recover", str(folder), "-q"]) == 0
    assert content(tmp_path / "run_recovered") == content(plain)


def test_counts_and_times_in_metadata_are_compared_with_the_files(plain, tmp_path, capsys):
    folder = tmp_path / "run"
    shutil.copytree(str(plain), str(folder))
    facts = yaml.safe_load((folder / "metadata.yaml").read_text())
    information = facts["rosbag2_bagfile_information"]
    total, topic = information["message_count"], information["topics_with_message_count"][0]
    right = topic["message_count"]
    with open_log(folder) as reader:
        assert not reader.index.notes
    information["message_count"] = 9990
    topic["message_count"] = 5000
    information["starting_time"]["nanoseconds_since_epoch"] = 5 * 10**17
    (folder / "metadata.yaml").write_text(yaml.safe_dump(facts))
    with open_log(folder) as reader:
        assert reader.message_count == total
    assert main(["convert", str(folder), str(tmp_path / "o.bag"), "-q"]) == 0
    notes = capsys.readouterr().err
    assert main(["info", "--freq", str(folder)]) == 0
    shown = capsys.readouterr().out
    assert main(["doctor", str(folder)]) == 1
    for told in (notes, shown, capsys.readouterr().out):
        assert "metadata.yaml tells of 9990 messages, the files hold %d" % total in told
        assert "%s: metadata.yaml tells of 5000 messages, the files hold %d" % (
            topic["topic_metadata"]["name"], right) in told
        assert "metadata.yaml tells of times from 500000000.000000000 to" in told
    assert main(["info", str(folder)]) == 0
    assert "the counts and times are by metadata.yaml" in capsys.readouterr().out


@pytest.mark.parametrize("kind", ["cut", "zeros", "root"])
def test_a_damaged_database_keeps_the_rows_that_can_be_reached(plain, tmp_path, capsys, kind):
    folder = by_rosbags(plain, tmp_path / "run", SQLITE3)
    database = folder / "run.db3"
    raw = database.read_bytes()
    middle = len(raw) // 2 // 4096 * 4096
    database.write_bytes({"cut": raw[:middle], "zeros": raw[:middle] + bytes(8192) + raw[middle + 8192:],
                          "root": b"SQLite format 3\0" + bytes(4080) + raw[4096:]}[kind])
    before = database.read_bytes()
    expected = content(plain)
    assert main(["doctor", str(folder)]) == 1
    out = capsys.readouterr().out
    code = main(["recover", str(folder), str(tmp_path / "o")])
    err = capsys.readouterr().err
    assert code == 1 and database.read_bytes() == before
    if kind == "root":
        assert "damaged: no message can be read" in out and "its topics cannot be read" in err
        assert not (tmp_path / "o").exists()
        return
    kept = content(tmp_path / "o")
    assert set(kept) <= set(expected) and len(set(kept)) == len(kept)
    assert len(kept) > len(expected) * (0.3 if kind == "cut" else 0.9)
    assert "rows from" in err and "cannot be read" in err
    assert main(["doctor", str(tmp_path / "o")]) == 0


def test_changes_of_a_writer_that_was_killed(plain, tmp_path, capsys):
    folder = by_rosbags(plain, tmp_path / "run", SQLITE3)
    metadata = (folder / "metadata.yaml").rename(tmp_path / "metadata.yaml")
    database = sqlite3.connect(str(folder / "run.db3"))
    database.execute("PRAGMA journal_mode=WAL")
    database.execute("PRAGMA wal_autocheckpoint=0")
    database.execute("INSERT INTO messages SELECT NULL, topic_id, timestamp + 1, data FROM messages WHERE id = 1")
    database.commit()
    killed = tmp_path / "killed"
    killed.mkdir()
    for path in folder.iterdir():
        shutil.copy(str(path), str(killed / path.name))
    database.close()
    assert (killed / "run.db3-wal").stat().st_size
    for command in ("info", "cat", "doctor"):
        assert main([command, str(killed / "run.db3")]) == 1
        told = "".join(capsys.readouterr())
        assert "left changes beside it (jaka_bag recover takes them up)" in told
    shutil.copytree(str(killed), str(tmp_path / "described"))
    shutil.copy(str(metadata), str(tmp_path / "described" / "metadata.yaml"))
    assert main(["cat", str(tmp_path / "described")]) == 1
    assert "left changes beside it (jaka_bag recover keeps" in capsys.readouterr().err
    assert main(["recover", str(killed / "run.db3"), str(tmp_path / "o.mcap"), "-q"]) == 0
    before = {path.name: path.read_bytes() for path in killed.iterdir()}
    assert main(["recover", str(killed), str(tmp_path / "o"), "-q"]) == 0
    assert {path.name: path.read_bytes() for path in killed.iterdir()} == before
    assert len(content(tmp_path / "o")) == len(content(plain)) + 1


def test_a_compressed_file_is_unpacked_up_to_its_damage(plain, tmp_path, capsys):
    folder = by_rosbags(plain, tmp_path / "run", MCAP, "FILE")
    packed = next(folder.glob("*.zstd"))
    packed.write_bytes(packed.read_bytes()[:packed.stat().st_size * 3 // 4])
    assert main(["recover", str(folder), str(tmp_path / "o")]) == 1
    assert "the compressed file was unpacked up to here" in capsys.readouterr().err
    kept = content(tmp_path / "o")
    assert kept and set(kept) < set(content(plain))


    assert main(["convert", str(folder), str(tmp_path / "o.bag"), "-q"]) == 1
    assert "run.mcap.zstd cannot be unpacked: it ends too early" in capsys.readouterr().err
    assert main(["convert", str(packed), str(tmp_path / "o.bag"), "-q"]) == 1
    assert "is compressed as a whole: unpack it (zstd -d), or give the rosbag2 folder" in capsys.readouterr().err


def test_a_compressed_folder_is_unpacked_once_and_removed(plain, tmp_path, monkeypatch):
    folder = by_rosbags(plain, tmp_path / "run", MCAP, "FILE")
    (tmp_path / "space").mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "space"))
    monkeypatch.setattr(rosbag2_reader, "_MESSAGES", 400)
    calls, real = [], rosbag2_folder.unpack_file
    monkeypatch.setattr(rosbag2_folder, "unpack_file", lambda *args: calls.append(args) or real(*args))
    with open_log(folder) as reader:
        assert len(reader.chunks) > 4
        assert sum(len(reader.load(chunk)) for chunk in reader.chunks) == len(content(plain))
    assert len(calls) == 1 and not list((tmp_path / "space").iterdir())


def damage(path, statement):
    database = sqlite3.connect(str(path))
    database.execute(statement)
    database.commit()
    database.close()


@pytest.mark.parametrize("statement, told", [
    ("UPDATE messages SET data = 'text' WHERE id = 5", "a row is damaged (jaka_bag recover keeps the rest)"),
    ("UPDATE messages SET data = x'28b52ffd00' WHERE id = 5", "a compressed"),
    ("UPDATE messages SET topic_id = 77 WHERE id = 5", "a row is damaged"),
    ("UPDATE topics SET name = x'41' WHERE id = 1", "a row is damaged"),
    ("DROP TABLE topics", "it is a database, but no storage of rosbag2")])
def test_a_damaged_database_is_refused_with_the_place_and_recovered(plain, tmp_path, capsys, statement, told):
    path = next(by_rosbags(plain, tmp_path / "run", SQLITE3).glob("*.db3"))
    damage(path, statement)
    for command in (["cat", str(path)], ["convert", str(path), str(tmp_path / "o.mcap"), "-q"]):
        assert main(command) == 1
        assert told in capsys.readouterr().err and not (tmp_path / "o.mcap").exists()
    if "DROP" in statement:
        return
    assert main(["recover", str(path), str(tmp_path / "kept.mcap")]) == 1
    assert 0 < len(read(tmp_path / "kept.mcap")) < len(content(plain))
    assert main(["doctor", str(tmp_path / "kept.mcap")]) == 0


def test_pages_that_lead_back_give_each_row_once(tmp_path, capsys):
    samples = state_log(2.0)
    path = write_database(tmp_path / "run.db3", samples)
    database = sqlite3.connect(str(path))
    (root,), (page,) = (database.execute(text).fetchone() for text in (
        "SELECT rootpage FROM sqlite_master WHERE name = 'messages'", "PRAGMA page_size"))
    database.close()
    raw = bytearray(path.read_bytes())
    at = (root - 1) * page
    kind, cells = raw[at], int.from_bytes(raw[at + 3:at + 5], "big")
    assert kind == 5 and cells > 8  # an inner page of a table, its cells begin with the numbers of the pages below
    places = [at + int.from_bytes(raw[at + 12 + 2 * i:at + 14 + 2 * i], "big") for i in range(cells)]
    for place in places[4:8]:
        raw[place:place + 4] = raw[places[1]:places[1] + 4]
    path.write_bytes(raw)
    assert main(["cat", str(path)]) == 1
    assert "a row is damaged (jaka_bag recover keeps the rest)" in capsys.readouterr().err
    assert main(["recover", str(path), str(tmp_path / "kept.mcap"), "-q"]) == 1
    kept = [(sample.connection.topic, sample.time) for sample in read(tmp_path / "kept.mcap")]
    assert len(samples) * 0.7 < len(kept) == len(set(kept)) < len(samples)


def test_a_large_database_is_read_in_windows(plain, tmp_path):
    path = next(by_rosbags(plain, tmp_path / "run", SQLITE3).glob("*.db3"))
    damage(path, "UPDATE messages SET data = zeroblob(300000) WHERE id % 20 = 0")
    with open_log(path) as reader:
        sizes = [len(reader.load(chunk).data) for chunk in reader.chunks]
        assert sum(len(reader.load(chunk)) for chunk in reader.chunks) == reader.message_count == len(content(plain))
        assert len(sizes) > 30 and max(sizes) < 2 << 20
        assert [a.end for a in reader.chunks[:-1]] == [b.position for b in reader.chunks[1:]]


def test_a_folder_becomes_a_log_of_ros2_messages_or_an_error(plain, tmp_path, capsys):
    assert main(["recover", str(plain), str(tmp_path / "o.mcap"), "-q"]) == 0
    assert main(["doctor", str(tmp_path / "o.mcap")]) == 0
    capsys.readouterr()
    (tmp_path / "none").mkdir()
    Path(tmp_path / "none" / "metadata.yaml").write_text("")
    for command in ("doctor", "recover"):
        assert main([command, str(tmp_path / "none")]) == 1
        assert "has no file of messages (.mcap, .db3)" in capsys.readouterr().err
    assert main(["recover", str(plain), str(tmp_path / "o.bag")]) == 1
    err = capsys.readouterr().err
    assert err.count("\n") == 1 and "a .bag holds ROS 1 messages only" in err
