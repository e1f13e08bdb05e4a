"""The answers of the commands about a drawn log, each compared with a walk over the records that the log is made of."""
import csv
import io
import json
import random
import sys
from collections import Counter
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from typing import Iterable, List, Tuple

import numpy as np
import pyarrow.parquet as parquet
from drawn_logs import DrawnLog, Entry
from log_samples import read

from jaka_bag.cli.main import main
from jaka_bag.live.log_source import LogSource
from jaka_bag.messages.selection import seconds_text


def run(*words: object) -> Tuple[int, str, str]:
    """Run a command; return its exit code, standard output and standard error."""
    out, err = io.StringIO(), io.StringIO()
    with redirect_stdout(out), redirect_stderr(err):
        code = main([str(word) for word in words])
    return code, out.getvalue(), err.getvalue()


def _facts(entries: Iterable[Entry]) -> List[Tuple[str, str, int, bytes]]:
    return [(entry.topic, "/n%d" % entry.channel, entry.time, entry.data) for entry in entries]


def _content(path: Path) -> List[Tuple[str, str, int, bytes]]:
    return [(s.connection.topic, s.connection.callerid, s.time, s.data) for s in read(path)]


def _check_content(path: Path, entries: List[Entry], what: str) -> None:
    """Compare a log with the messages that it ought to hold; equal times may be in any order."""
    found = _content(path)
    assert sorted(found) == sorted(_facts(entries)), what
    assert [fact[2] for fact in found] == sorted(fact[2] for fact in found), what


def _written(words: Tuple[object, ...], target: Path, entries: List[Entry]) -> None:
    """Run a command that writes a log, and compare the log; where nothing is wanted the exit code is 2."""
    target.unlink(missing_ok=True)
    code, _, err = run(*words, "-o", target, "-q", "-f")
    assert code == (0 if entries else 2), (words, err)
    if entries:
        _check_content(target, entries, str(words))


def _table_of(path: Path, topic: str, topics: int, suffix: str) -> Path:
    """Return the file that ``export -o out.SUFFIX`` writes for a topic."""
    return path / ("out_%s%s" % (topic.strip("/").replace("/", "_"), suffix) if topics > 1 else "out" + suffix)


def _check_tables(log: DrawnLog, folder: Path) -> None:
    """Compare the tables and the picture of a log's topics."""
    topics = sorted({entry.topic for entry in log.messages})
    code, _, err = run("export", log.path, "-o", folder / "out.csv", "-f", "-q")
    assert code == 0, err
    for topic in topics:
        rows = list(csv.DictReader(_table_of(folder, topic, len(topics), ".csv").read_text().splitlines()))
        assert [(row["log_time"], int(row["motion_state"])) for row in rows] == [
            ("%d.%09d" % divmod(entry.time, 10**9), entry.value) for entry in log.messages if entry.topic == topic]
    code, out, err = run("plot", log.path, folder / "out.svg", "--field", topics[0] + ":motion_state", "-f", "--json")
    assert code == 0 and json.loads(out)["diagrams"] == 1, err


def _check_elsewhere(log: DrawnLog, folder: Path) -> None:
    """Compare what costs more: Parquet, a data set of it, and a rosbag2 folder."""
    topics = sorted({entry.topic for entry in log.messages})
    wanted = {topic: [(entry.time, entry.value) for entry in log.messages if entry.topic == topic] for topic in topics}
    code, _, err = run("export", log.path, "-o", folder / "out.parquet", "-f", "-q")
    assert code == 0, err
    data_set = folder / (log.path.stem + ".set")
    code, _, err = run("dataset", "add", log.path, "--to", data_set, "--cell", "a", "-q")
    assert code == 0, err
    for topic in topics:
        in_set, = data_set.glob("topic=%s/*/*.parquet" % topic.strip("/").replace("/", "*"))
        for path in (_table_of(folder, topic, len(topics), ".parquet"), in_set):
            table = parquet.ParquetFile(path).read(["log_time", "motion_state"])
            times = table["log_time"].cast("int64").to_pylist()
            assert list(zip(times, table["motion_state"].to_pylist())) == wanted[topic], path
    code, _, err = run("convert", log.path, folder / "ros2", "--profile", "ros2", "-f", "-q")
    assert code == 0, err
    if sys.version_info < (3, 9) and any(entry.time == 0 for entry in log.messages):
        return  # rosbags 0.9, which reads the folder there, leaves out chunks that begin at 0
    assert sorted((s.connection.topic, s.time, s.data) for s in read(folder / "ros2")) == sorted(
        (entry.topic, entry.time, entry.data) for entry in log.messages)


def check(log: DrawnLog, seed: int, folder: Path) -> None:
    """Compare the answers of all commands about a log with the truth.

    Raises:
        AssertionError: One differs.
    """
    dice = random.Random(seed)
    entries = log.messages
    path = log.path
    counts = Counter(entry.topic for entry in entries)
    first, last = entries[0].time, entries[-1].time

    code, out, err = run("info", "--freq", "--json", path)
    document = json.loads(out)
    assert code == 0 and document["messages"] == len(entries), err
    assert (document["start_ns"], document["end_ns"]) == (first, last)
    assert {t["topic"]: t["messages"] for t in document["topics"]} == counts
    for topic in document["topics"]:
        times = [entry.time for entry in entries if entry.topic == topic["topic"]]
        assert topic["freq"]["messages"] == len(times)
        span = (times[-1] - times[0]) / 1e9
        if span > 0:
            assert np.isclose(topic["freq"]["rate"], (len(times) - 1) / span)

    code, out, _ = run("du", "--json", path)
    assert code == 0 and {t["topic"]: t["messages"] for t in json.loads(out)["files"][0]["topics"]} == counts

    code, out, _ = run("doctor", "--json", path)
    assert (json.loads(out)["files"][0]["verdict"] != "damaged") == (code == 0)
    assert json.loads(out)["files"][0]["messages"] == len(entries)
    if log.lie in ("chunk_count", "index_time", "index_lacks", "index_offset", "total"):  # others may be true by chance
        assert "the index" in out and code == 1, out
        assert log.lie == "index_offset" or any("the index" in note for note in document["notes"]), document["notes"]

    begin, end = sorted(dice.choice(entries).time + dice.choice((0, 1, -1, 10**8)) for _ in range(2))
    begin, end = max(begin, 0), min(max(end, 0), last)
    span: Tuple[object, ...] = ("--start", "@" + seconds_text(begin), "--end", "@" + seconds_text(end))
    inside = [entry for entry in entries if begin <= entry.time <= end] if first <= end and begin <= last else []
    topic = dice.choice(sorted(counts))
    target = folder / dice.choice(("out.bag", "out.mcap"))
    _written(("convert", path), target, entries)
    _written(("convert", path) + span, target, inside)
    _written(("filter", path, "-t", topic) + span, target, [entry for entry in inside if entry.topic == topic])
    _written(("merge", path), target, entries)

    code, out, err = run("cat", path, *span)
    assert code == (0 if inside or begin <= last and first <= end else 2), err
    assert [(line["topic"], line["log_time_ns"], line["message"]["motion_state"])
            for line in map(json.loads, out.splitlines())] == [(e.topic, e.time, e.value) for e in inside]

    code, out, err = run("split", path, "-o", folder / "part.mcap", "--count", 7, "-f", "-q")
    parts = [part for i in range(len(entries)) for part in [folder / ("part_%d.mcap" % i)] if part.exists()]
    assert code == 0, err
    assert sorted(t for part in parts for t in _content(part)) == sorted(_facts(entries))
    for part in parts:
        part.unlink()

    code, _, err = run("export", path, "-o", folder / "out.npz", "-f", "-q")
    assert code == 0, err
    with np.load(folder / "out.npz") as arrays:
        for name in counts:
            values = sorted(entry.value for entry in entries if entry.topic == name)
            assert sorted(arrays["%s/motion_state" % name.strip("/")]) == values

    _check_tables(log, folder)
    if not seed % 20:
        _check_elsewhere(log, folder)

    code, _, err = run("recover", path, target, "-f", "-q")
    _check_content(target, entries, "recover")

    code, out, err = run("compare", path, path, "--json")
    counted = {c["topic"]: c["golden"] for c in json.loads(out)["checks"] if c["check"] == "counts"}
    assert code < 2 and counted.items() <= {name: str(count) for name, count in counts.items()}.items(), (counted, err)

    source = LogSource([str(path)])
    try:
        at = dice.choice(entries).time
        newest = source.newest(at, range(len(source.connections)))
        wanted = {}
        for entry in entries:
            if entry.time <= at:
                wanted["/n%d" % entry.channel] = entry.time
        assert {source.connections[m.connection].callerid: m.time for m in newest} == wanted
        assert len(list(source.play(None, None))) == len(entries)
    finally:
        source.close()
