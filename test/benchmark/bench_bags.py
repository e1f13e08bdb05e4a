"""The speed of jaka_bag on files, beside its peers, in one run.

Every program is a process of its own, start-up included. Peers: cp, zstd -1 (and with -T2), Debian's rosbag, rosbags,
the mcap library, rosbags-convert, and pymcap-cli where it is found
(it is no part of this project: install it into an environment of your own and name it with --pymcap-cli).
The rounds are interleaved, the best of each counts; CPU is user and system time, memory the peak of the resident set.
On a busy machine the ratio of CPU times says more than that of wall times.

    build/venv/bin/python3 test/benchmark/bench_bags.py
"""
import argparse
import json
import os
import random
import shutil
import struct
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Dict, List, NamedTuple, Optional, Sequence

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "tools"), str(ROOT / "test" / "support"), str(ROOT / "test" / "support" / "live"),
                str(ROOT / "test" / "support" / "logs")]

import numpy as np  # noqa: E402
from command_places import command_of  # noqa: E402
from log_samples import JOINTS, START_NS, STATES, TOOL, connection, joints, tool  # noqa: E402

from jaka_bag.containers.bag.writer import BagWriter  # noqa: E402
from jaka_bag.containers.registry import open_log  # noqa: E402
from jaka_bag.containers.time_order import messages_of  # noqa: E402

RATE_HZ = 125
JAKA_BAG = command_of("jaka_bag")
BLOB = connection("/blob", "bench/Blob", "uint8[4092] data\n")

ROSBAGS_TO_MCAP = """
import sys
from rosbags.rosbag1 import Reader
from mcap.writer import Writer
with Reader(sys.argv[1]) as reader, open(sys.argv[2], "wb") as stream:
    writer = Writer(stream)
    writer.start("ros1")
    channels = {}
    for c in reader.connections:
        schema = writer.register_schema(c.msgtype.replace("/msg/", "/"), "ros1msg", str(c.msgdef.data).encode())
        channels[c.id] = writer.register_channel(c.topic, "ros1", schema)
    for c, time, data in reader.messages():
        writer.add_message(channels[c.id], time, bytes(data), time)
    writer.finish()
"""
MCAP_TO_ROSBAGS = """
import sys
from pathlib import Path
from mcap.reader import make_reader
from rosbags.rosbag1 import Writer
with open(sys.argv[1], "rb") as stream, Writer(Path(sys.argv[2])) as writer:
    connections = {}
    for schema, channel, message in make_reader(stream).iter_messages(log_time_order=False):
        if channel.id not in connections:
            connections[channel.id] = writer.add_connection(
                channel.topic, schema.name.replace("/", "/msg/"), msgdef=schema.data.decode(),
                md5sum=channel.metadata["md5sum"])
        writer.write(connections[channel.id], message.log_time, message.data)
"""
ROSBAGS_DECODES = """
import sys
from pathlib import Path
from rosbags.highlevel import AnyReader
with AnyReader([Path(sys.argv[1])]) as reader:
    for c, time, data in reader.messages():
        reader.deserialize(data, c.msgtype)
"""
COLUMNS = """
import sys
sys.path.insert(0, %r)
from jaka_bag.operations.columns import read_columns
read_columns(sys.argv[1])
""" % str(ROOT / "tools")


class Cost(NamedTuple):
    """The cost of one run of a command: wall time and CPU time, s; memory, byte; exit code."""

    wall: float
    cpu: float
    memory: int
    code: int


class Entry(NamedTuple):
    """One command of a comparison, and the goal for our speed over its (None: no goal)."""

    name: str
    command: Sequence[str]
    outputs: Sequence[Path] = ()
    goal: Optional[float] = None


LAUNCHER = """
import json, os, sys, time
answer = os.dup(1)
os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
begin = time.perf_counter()
pid = os.spawnvp(os.P_NOWAIT, sys.argv[1], sys.argv[1:])
_, status, usage = os.wait4(pid, 0)
wall = time.perf_counter() - begin
code = os.WEXITSTATUS(status) if os.WIFEXITED(status) else -os.WTERMSIG(status)
os.write(answer, json.dumps([wall, usage.ru_utime + usage.ru_stime, usage.ru_maxrss * 1024, code]).encode())
"""  # a small process of its own: a program's peak of memory begins with that of its parent


def run(command: Sequence[object], accept: Sequence[int] = (0,)) -> Optional[Cost]:
    """Run a command to its end and return its cost by its own clock, without polling; None, with its output shown,
    where it fails."""
    environment = dict(os.environ, PYTHONPATH="%s:%s" % (ROOT / "tools", os.environ.get("PYTHONPATH", "")))
    done = subprocess.run([sys.executable, "-I", "-S", "-c", LAUNCHER, *map(str, command)], check=True,
                          capture_output=True, env=environment)
    cost = Cost(*json.loads(done.stdout))
    if cost.code not in accept:
        print("  exit code %d: %s\n%s" % (cost.code, " ".join(map(str, command))[:200],
                                         done.stderr.decode("utf-8", "replace")[-2000:]))
        return None
    return cost


def remove(paths: Sequence[Path]) -> None:
    for path in paths:
        if path.is_dir():
            shutil.rmtree(str(path))
        elif path.exists():
            path.unlink()


def compare(title: str, entries: List[Entry], rounds: int, size: int, count: int, accept: Sequence[int] = (0,)) -> None:
    """Print one table; the first entry is ours."""
    best: Dict[str, Cost] = {}
    for _ in range(rounds):
        for entry in entries:
            remove(entry.outputs)
            cost = run(entry.command, accept)
            if cost is None:
                continue
            kept = best.get(entry.name, cost)
            best[entry.name] = Cost(*map(min, zip(cost, kept)))
    print("\n%s" % title)
    print("  %-34s %8s %8s %8s %10s %9s %8s %8s  %s" % ("", "wall s", "CPU s", "MB/s", "msg/s", "memory", "x wall",
                                                       "x CPU", "goal"))
    ours = best.get(entries[0].name)
    for entry in entries:
        cost = best.get(entry.name)
        if cost is None or ours is None:
            continue
        ratios = ("", "") if entry is entries[0] else ("%.2f" % (cost.wall / ours.wall), "%.2f" % (cost.cpu / ours.cpu))
        verdict = "" if entry.goal is None else "%.4g %s" % (entry.goal, "ok" if cost.wall / ours.wall >= entry.goal
                                                             else "MISSED")
        print("  %-34s %8.3f %8.3f %8.0f %10.0f %6.0f MB %8s %8s  %s" % (
            entry.name, cost.wall, cost.cpu, size / cost.wall / 1e6, count / cost.wall, cost.memory / 1e6, *ratios,
            verdict))
    sys.stdout.flush()


def write_state_log(path: Path, seconds: float) -> int:
    """Write the three topics of the driver; return the number of messages."""
    dice = random.Random(7)
    with BagWriter(path) as writer:
        numbers = {c: writer.add_channel(c) for c in (TOOL, JOINTS, STATES)}
        for i in range(int(seconds * RATE_HZ)):
            time = START_NS + i * 10**9 // RATE_HZ + dice.randrange(200000)
            phase = i / RATE_HZ
            pose = np.sin(phase + np.arange(6)) + np.array([dice.gauss(0, 1e-5) for _ in range(6)])
            for sample in (tool(i, time, pose[::-1]), joints(i, time + 20000, pose)):
                writer.add_message(numbers[sample.connection], sample.time, sample.data)
            state = struct.pack("<4h", 3 if int(phase) % 7 else 0, 1, 0, 0)
            writer.add_message(numbers[STATES], time + 40000, state)
        writer.flush()
        return writer.message_count


def write_blobs(path: Path, count: int) -> int:
    """Write messages of 4 KB at 1 kHz; return their number."""
    source = np.random.RandomState(3).randint(0, 256, 1 << 20, np.uint8)
    source[::2] = 0
    raw = source.tobytes()
    with BagWriter(path) as writer:
        number = writer.add_channel(BLOB)
        for i in range(count):
            at = i * 97 % (len(raw) - 4096)
            writer.add_message(number, START_NS + i * 10**6, raw[at:at + 4092])
        writer.flush()
        return writer.message_count


def python(code: str, *words: object) -> List[str]:
    return [sys.executable, "-c", code, *map(str, words)]


def cdr_differences(ours: Path, theirs: Path) -> str:
    """Return how the messages of two rosbag2 folders differ."""
    from rosbags.rosbag2 import Reader
    different = count = 0
    with Reader(ours) as a, Reader(theirs) as b:
        for (c, t, x), (d, u, y) in zip(a.messages(), b.messages()):
            count += 1
            different += (c.topic, c.msgtype, t, bytes(x)) != (d.topic, d.msgtype, u, bytes(y))
        same_count = a.message_count == b.message_count == count
    return "%d messages, %d different%s" % (count, different, "" if same_count else ", COUNTS DIFFER")


def main() -> None:
    """Make the logs, run everything, print the tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--minutes", type=float, default=30.0, help="length of the state log (default 30)")
    parser.add_argument("--rounds", type=int, default=3, help="rounds of each comparison (default 3)")
    parser.add_argument("--pymcap-cli", default=shutil.which("pymcap-cli"), help="path of the program")
    parser.add_argument("--only", default="", help="run comparisons whose title holds this word")
    parser.add_argument("--folder", help="where to work (default: memory, /dev/shm)")
    args = parser.parse_args()
    with tempfile.TemporaryDirectory(dir=args.folder or "/dev/shm", prefix="bench_bags.") as name:
        bench(Path(name), args)


def bench(folder: Path, args: argparse.Namespace) -> None:
    bag, mcap, blobs, cut = (folder / n for n in ("state.bag", "state.mcap", "blobs.bag", "cut.bag"))
    count = write_state_log(bag, args.minutes * 60)
    size = bag.stat().st_size
    print("state log: %.1f min, %d messages, %.1f MB; Python %s, numpy %s, %d cores, load %.1f" % (
        args.minutes, count, size / 1e6, sys.version.split()[0], np.__version__, os.cpu_count() or 0,
        os.getloadavg()[0]))
    run(JAKA_BAG + ["convert", bag, "-o", mcap])
    rosbag = shutil.which("rosbag")
    out, made, folder2, other2 = folder / "out.mcap", folder / "out.bag", folder / "ours2", folder / "theirs2"
    peer = folder / "peer.mcap"
    convert_tool = str(Path(sys.executable).with_name("rosbags-convert"))

    def table(title: str, entries: List[Optional[Entry]], size: int = size, count: int = count,
              accept: Sequence[int] = (0,)) -> None:
        if args.only in title:
            compare(title, [e for e in entries if e is not None], args.rounds, size, count, accept)

    def pymcap(source: Path, goal: float) -> Optional[Entry]:
        return Entry("pymcap-cli bag2mcap", [args.pymcap_cli, "bag2mcap", str(source), "-o", str(peer)], [peer],
                     goal) if args.pymcap_cli else None

    table("convert: .bag -> .mcap, ros1 profile, zstd", [
        Entry("jaka_bag convert", JAKA_BAG + ["convert", bag, "-o", out, "-q"], [out]),
        pymcap(bag, 12), Entry("rosbags Reader -> mcap Writer", python(ROSBAGS_TO_MCAP, bag, peer), [peer], 15),
        Entry("zstd -1", ["zstd", "-1", "-q", "-f", str(bag), "-o", str(folder / "x.zst")], [], 1 / 1.5),
        Entry("zstd -1 -T2", ["zstd", "-1", "-T2", "-q", "-f", str(bag), "-o", str(folder / "x.zst")], [], 1.0),
        Entry("cp", ["cp", str(bag), str(folder / "copy.bag")])])
    table("convert: .bag -> rosbag2 folder, CDR, zstd", [
        Entry("jaka_bag convert --profile ros2", JAKA_BAG + ["convert", bag, "-o", folder2, "--profile", "ros2", "-q"],
              [folder2]),
        Entry("rosbags-convert", [convert_tool, "--src", str(bag), "--dst", str(other2), "--dst-storage", "mcap",
                                  "--compress", "zstd", "--compress-mode", "storage"], [other2], 15)])
    if folder2.exists() and other2.exists():
        print("  the two folders: %s" % cdr_differences(folder2, other2))
    table("convert: .mcap -> .bag", [
        Entry("jaka_bag convert", JAKA_BAG + ["convert", mcap, "-o", made, "-q"], [made]),
        Entry("mcap reader -> rosbags Writer", python(MCAP_TO_ROSBAGS, mcap, folder / "peer.bag"),
              [folder / "peer.bag"], 15)])
    table("columns: all fields of all messages", [
        Entry("read_columns", python(COLUMNS, bag)),
        Entry("rosbags deserialises", python(ROSBAGS_DECODES, bag), [], 15)])
    table("info", [
        Entry("jaka_bag info", JAKA_BAG + ["info", bag]), Entry("jaka_bag info, .mcap", JAKA_BAG + ["info", mcap]),
        Entry("rosbag info", ["rosbag", "info", str(bag)], [], 3) if rosbag else None])
    table("info --freq: rate, jitter, gaps", [
        Entry("jaka_bag info --freq", JAKA_BAG + ["info", "--freq", bag]),
        Entry("rosbag info --freq", ["rosbag", "info", "--freq", str(bag)], [], 8) if rosbag else None])
    with bag.open("rb") as stream:
        cut.write_bytes(stream.read(size * 2 // 3))
    fixed = folder / "fixed.bag"
    table("recover: a bag cut off at two thirds", [
        Entry("jaka_bag recover", JAKA_BAG + ["recover", cut, made, "-q"], [made]),
        Entry("rosbag reindex", ["sh", "-c", "cp %s %s && rosbag reindex -f -q %s" % (cut, fixed, fixed)], [fixed], 10)
        if rosbag else None], size * 2 // 3, count * 2 // 3, (0, 1))
    for name, path in (("jaka_bag", made), ("rosbag", fixed)):
        if path.exists() and args.only in "recover":
            with open_log(path) as reader:
                print("  %s recovered %d messages" % (name, reader.message_count))
    table("filter: one topic", [
        Entry("jaka_bag filter", JAKA_BAG + ["filter", bag, "-o", made, "-t", JOINTS.topic, "-q"], [made]),
        Entry("rosbags-convert", [convert_tool, "--src", str(bag), "--dst", str(other2), "--include-topic",
                                  JOINTS.topic], [other2])])
    remove([out, made, folder2, other2, peer, cut, fixed])
    blob_count = write_blobs(blobs, int(args.minutes * 4000))
    table("convert: 4 KB messages, .bag -> .mcap, zstd", [
        Entry("jaka_bag convert", JAKA_BAG + ["convert", blobs, "-o", out, "-q"], [out]), pymcap(blobs, 2.5),
        Entry("zstd -1", ["zstd", "-1", "-q", "-f", str(blobs), "-o", str(folder / "x.zst")]),
        Entry("cp", ["cp", str(blobs), str(folder / "copy.bag")])], blobs.stat().st_size, blob_count)
    run(JAKA_BAG + ["convert", mcap, "-o", made])
    with open_log(bag) as a, open_log(made) as b:
        same = a.connections == b.connections and all(x == y for x, y in zip(messages_of(a), messages_of(b)))
        print("\n.bag -> .mcap -> .bag: %d and %d messages, %s" % (
            a.message_count, b.message_count, "identical" if same and a.message_count == b.message_count else "DIFFER"))


if __name__ == "__main__":
    main()
