"""Every reading command on rosbag2's storages: folders of both, compressed in each way, and files without their folder.

The commands are those of the table whose first argument is a log by its own help; a new one is walked, too.
"""
import io
import json
import re
import shutil
from contextlib import redirect_stderr, redirect_stdout

import numpy as np
import pytest
from command_parsers import parser
from log_samples import STATES, read, state_log, write

from jaka_bag.cli.main import COMMANDS, is_installed, main
from jaka_bag.live.log_source import LogSource

pytest.importorskip("matplotlib")
parquet = pytest.importorskip("pyarrow.parquet")
rosbag2 = pytest.importorskip("rosbags.rosbag2")
if not hasattr(rosbag2, "StoragePlugin"):
    pytest.skip("this rosbags writes no sqlite3 of these types", allow_module_level=True)
MODES = ("", "FILE", "MESSAGE")
FOLDERS = ["%s%s" % (storage, mode) for storage in ("MCAP", "SQLITE3") for mode in MODES]
LONE = ["MCAP", "MCAPMESSAGE", "SQLITE3", "SQLITE3MESSAGE"]
RUN_ELSEWHERE = {"play", "serve", "replay-commands", "replay-motion", "report"}
"""Commands that need a ROS master, a driver or its topics; they read by ``LogSource`` or ``open_log``."""
FURTHER = {"split": ["--count", "20"], "plot": ["--field", STATES.topic + ":motion_state"], "compare": ["LOG"],
           "info": ["--freq", "--json"], "du": ["--json"], "attach": [__file__], "dataset add": ["--to", "OUT"]}
"""Words that a command needs besides the log and the output."""
SUFFIX = {"plot": ".svg", "export": ".npz"}
KEYS = {"info": ("profile", "start_ns", "end_ns", "messages", "types", "topics"),
        "du": ("topic", "type", "messages", "payload_bytes")}
"""Facts that do not depend on how a storage keeps the messages."""


def arguments(name):
    return [action for action in parser("jaka_bag", name.split())._actions if not action.option_strings]


def reading():
    """Return the commands that read logs."""
    return [name for name in COMMANDS
            if is_installed(name) and arguments(name) and ".bag" in (arguments(name)[0].help or "")]


def has(name, option):
    return any(option in action.option_strings for action in parser("jaka_bag", name.split())._actions)


def facts(name, text):
    """Return what a command printed, without what depends on the storage."""
    if name not in KEYS:
        return re.sub(r"[\d.]+ s\b|[\d.]+ .?B\b", "", text)
    document = json.loads(text)
    rows = document["files"][0]["topics"] if name == "du" else [document]
    return sorted((tuple((key, row[key]) for key in KEYS[name]) for row in rows), key=str)


def content(path):
    """Return what is in an output, of whichever kind."""
    if path.is_dir():  # a data set: the names of its tables are hashes of the log
        return sorted((each.parent.name, parquet.read_metadata(str(each)).num_rows) for each in path.rglob("*.parquet"))
    if path.suffix == ".mcap":
        return [(s.connection.topic, s.connection.datatype, s.time, s.data) for s in read(path)]
    if path.suffix == ".npz":
        with np.load(path) as arrays:
            return {key: arrays[key].tolist() for key in arrays}
    if path.suffix == ".svg":  # its lines; where they are depends on the size of the log's name, which is the title
        lines = re.sub(r"(?s)<defs>.*?</defs>", "", path.read_text(encoding="utf-8"))
        return [re.sub(r"[\d.]+", "1", line) for line in re.findall(r' d="([^"]*)"', lines)]
    return path.read_bytes()


def answer(name, log, place):
    """Run a command on a log; return its exit code, what it says, and what it writes."""
    place.mkdir()
    out = place / ("out" + SUFFIX.get(name, ".mcap"))
    places = {"LOG": log, "OUT": place / "set"}
    words = [*name.split(), log, *[places.get(word, word) for word in FURTHER.get(name, [])]]
    if has(name, "-o"):
        words += ["-o", out, *(["-q"] if has(name, "-q") else [])]
    said, told = io.StringIO(), io.StringIO()
    with redirect_stdout(said), redirect_stderr(told):
        code = main(list(map(str, words)))
    text = said.getvalue().replace(str(place), "PLACE").replace(str(log), "LOG").replace(log.name, "NAME")
    assert code == 0, (name, told.getvalue())
    return facts(name, text), {each.name: content(each) for each in sorted(place.iterdir())}


@pytest.fixture(scope="module")
def storages(tmp_path_factory):
    """Return folders that rosbags wrote, by storage and mode of compression; all hold the same messages."""
    place = tmp_path_factory.mktemp("storages")
    source = write(place / "source.bag", state_log(0.3))
    assert main(["convert", str(source), str(place / "run"), "--profile", "ros2", "-q"]) == 0
    for name in FOLDERS:
        storage = name.replace("FILE", "").replace("MESSAGE", "")
        (place / name).mkdir()
        writer = rosbag2.Writer(place / name / "run", version=9, storage_plugin=rosbag2.StoragePlugin[storage])
        if name != storage:
            writer.set_compression(rosbag2.CompressionMode[name[len(storage):]], rosbag2.CompressionFormat.ZSTD)
        with rosbag2.Reader(place / "run") as reader, writer:
            new = {c.id: writer.add_connection(c.topic, c.msgtype, msgdef=c.msgdef.data, rihs01=c.digest,
                                               offered_qos_profiles=c.ext.offered_qos_profiles)
                   for c in reader.connections}
            for connection, log_time, raw in reader.messages():
                writer.write(new[connection.id], log_time, raw)
    for name in LONE:
        suffix = ".mcap" if name.startswith("MCAP") else ".db3"
        (place / ("lone" + name)).mkdir()
        shutil.copy(str(place / name / "run" / ("run" + suffix)), str(place / ("lone" + name)))
    return place


def lone(storages):
    """Return the files without their folders: the plain MCAP, and the others."""
    first, *others = [next((storages / ("lone" + name)).iterdir()) for name in LONE]
    return first, others


def test_the_walk_finds_the_commands():
    assert {"info", "cat", "convert", "filter", "merge", "split", "recover", "du", "doctor", "plot", "export",
            "compare", "play", "dataset add"} <= set(reading())
    assert RUN_ELSEWHERE | set(FURTHER) <= set(COMMANDS)


def walk(first, others, place):
    """Compare the answers of the commands about several logs with those about the first."""
    for name in reading():
        if name in RUN_ELSEWHERE:
            continue
        wanted = answer(name, first, place / ("first_" + name))
        assert any(map(bool, wanted)), name
        for number, other in enumerate(others):
            assert answer(name, other, place / ("%s_%d" % (name, number))) == wanted, (name, other)


def test_a_compressed_folder_is_read_as_a_plain_one(storages, tmp_path):
    walk(storages / "MCAP" / "run", [storages / name / "run" for name in FOLDERS[1:]], tmp_path)


def test_a_lone_database_is_read_as_a_lone_mcap(storages, tmp_path):
    walk(*lone(storages), tmp_path)


def test_what_plays_reads_every_storage(storages):
    def played(path):
        source = LogSource([str(path)])
        try:
            return [(source.connections[m.connection].topic, m.time, m.frame) for m in source.play(None, None)]
        finally:
            source.close()

    first, *others = [played(storages / name / "run") for name in FOLDERS] + [
        played(path) for path in [lone(storages)[0], *lone(storages)[1]]]
    assert len(first) == len(state_log(0.3)) and all(other == first for other in others)
