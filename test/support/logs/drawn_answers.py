"""The answers of the commands about a drawn log, each compared with a walk over the records that the log is made of."""
import io
import json
import random
from collections import Counter
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from typing import Iterable, List, Tuple

import numpy as np
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
    if log.lie not in ("none", "chunk_time", "no_index"):  # a time may be true by chance, an MCAP need have no index
        assert "the index" in out and code == 1, out

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
