"""The messages, time and memory of recovering damaged logs, beside rosbag reindex and other software for MCAP.

These are pymcap-cli recover, and a script by the rules of mcap recover (``mcap_recover_rules``).

The logs are those of a driver, written by rosbag (.bag: none, lz4, bz2) and the library mcap (.mcap: none, lz4, zstd,
without chunks), and damaged by chance: cut, bits flipped, overwritten with zeros or noise, bytes missing or put in.
What a program keeps is read by rosbag and mcap, up to their first error, and compared with the whole log.
A message counts as kept where topic, time and bytes are as they were, else as altered.

    build/venv/bin/python3 test/benchmark/bench_recover.py
    build/venv/bin/python3 test/benchmark/bench_recover.py --files 20 --first 40 --verbose
"""
import argparse
import os
import random
import shutil
import sys
import tempfile
from collections import Counter
from pathlib import Path
from typing import Counter as CounterOf
from typing import Dict, List, NamedTuple, Tuple

import genpy
import rosbag
from bench_bags import JAKA_BAG, Cost, remove, run  # its import prepares the paths of tests and tools
from log_samples import Sample, state_log
from mcap.reader import make_reader
from mcap.writer import CompressionType
from mcap.writer import Writer as McapLibraryWriter

RULES = Path(__file__).parents[1] / "support" / "logs" / "mcap_recover_rules.py"
SECONDS = 8.0
FORMS = ("bag none", "bag lz4", "bag bz2", "mcap none", "mcap lz4", "mcap zstd", "mcap unchunked")
DAMAGES = ("cut", "one bit", "bits", "zeros", "noise", "missing", "put in")
Key = Tuple[str, int, bytes]


class Outcome(NamedTuple):
    """The result of one program for one file: its cost, and the messages that it kept."""

    cost: Cost
    kept: CounterOf[Key]


def write_bag(path: Path, samples: List[Sample], codec: str, chunk_size: int) -> None:
    # by rosbag itself: what its reindex makes of bags by others, whose first record is shorter, no program reads
    with rosbag.Bag(str(path), "w", compression=codec, chunk_threshold=chunk_size) as bag:
        for sample in samples:
            c = sample.connection
            kind = type("Kind", (), {"_type": c.datatype, "_md5sum": c.md5sum, "_full_text": c.definition})
            bag.write(c.topic, (c.datatype, sample.data, c.md5sum, kind), genpy.Time(*divmod(sample.time, 10**9)),
                      raw=True)


def write_mcap(path: Path, samples: List[Sample], codec: str, chunk_size: int) -> None:
    kinds = {"none": CompressionType.NONE, "lz4": CompressionType.LZ4, "zstd": CompressionType.ZSTD}
    with path.open("wb") as stream:
        writer = McapLibraryWriter(stream, chunk_size=chunk_size, compression=kinds.get(codec, CompressionType.NONE),
                                   use_chunking=codec != "unchunked")
        writer.start("ros1", "bench")
        channels = {}
        for c in dict.fromkeys(sample.connection for sample in samples):
            schema = writer.register_schema(c.datatype, "ros1msg", c.definition.encode())
            channels[c] = writer.register_channel(c.topic, "ros1", schema, {"md5sum": c.md5sum})
        for sample in samples:
            writer.add_message(channels[sample.connection], sample.time, sample.data, sample.time)
        writer.finish()


def damaged(raw: bytes, kind: str, dice: random.Random) -> bytes:
    """Return a file's bytes with one damage of a kind; the first 64 bytes stay."""
    at = dice.randrange(64, len(raw))
    size = dice.choice((1, 20, 512, 4096))
    if kind == "cut":
        return raw[:at]
    if kind == "missing":
        return raw[:at] + raw[at + size:]
    if kind == "put in":
        return raw[:at] + bytes(dice.randrange(256) for _ in range(size)) + raw[at:]
    out = bytearray(raw)
    if kind in ("zeros", "noise"):
        out[at:at + size] = bytes(size if kind == "zeros" else 0) or bytes(dice.randrange(256) for _ in range(size))
        return bytes(out[:len(raw)])
    for _ in range(1 if kind == "one bit" else 12):
        out[dice.randrange(64, len(raw))] ^= 1 << dice.randrange(8)
    return bytes(out)


def messages_in(path: Path) -> CounterOf[Key]:
    """Count the messages of a result, up to the first error of the library that reads it."""
    found: CounterOf[Key] = Counter()
    try:
        if path.suffix == ".bag":
            with rosbag.Bag(str(path)) as bag:
                for topic, message, time in bag.read_messages(raw=True):
                    found[topic, time.to_nsec(), message[1]] += 1
        else:
            with path.open("rb") as stream:
                for _, channel, message in make_reader(stream).iter_messages(log_time_order=False):
                    found[channel.topic, message.log_time, message.data] += 1
    except Exception:  # whatever a library meets in a file that is not whole: the messages before it count
        pass
    return found


def programs(form: str, pymcap: str) -> Dict[str, List[str]]:
    """Return the commands by program; IN and OUT stand for the files."""
    found = {"jaka_bag recover": [*JAKA_BAG, "recover", "IN", "OUT", "-q"]}
    if form.startswith("bag") and shutil.which("rosbag"):
        found["rosbag reindex"] = ["sh", "-c", "cp IN OUT && rosbag reindex -f -q OUT"]
    if form.startswith("mcap"):
        found["rules of mcap recover"] = [sys.executable, str(RULES), "IN", "OUT"]
    if form.startswith("mcap") and pymcap:
        found["pymcap-cli recover"] = [pymcap, "recover", "IN", "-o", "OUT", "--quiet"]
    return found


def recovered(command: List[str], source: Path, folder: Path) -> Outcome:
    target = folder / ("kept" + source.suffix)
    words = [word.replace("IN", str(source)).replace("OUT", str(target)) if word in ("IN", "OUT") or "IN OUT" in word
             else word for word in command]
    cost = run(words, range(-64, 256))
    assert cost is not None
    kept = messages_in(target) if target.exists() else Counter()
    remove([target, target.with_suffix(".orig" + source.suffix)])
    return Outcome(cost, kept)


class Totals:
    """The sums of one program over the files of a format."""

    def __init__(self) -> None:
        self.files = self.kept = self.altered = self.of = self.nothing = 0
        self.wall = 0.0
        self.memory = 0

    def add(self, outcome: Outcome, whole: CounterOf[Key]) -> None:
        """Add a file."""
        kept = sum((outcome.kept & whole).values())
        self.files += 1
        self.kept += kept
        self.altered += sum(outcome.kept.values()) - kept
        self.of += sum(whole.values())
        self.nothing += not kept
        self.wall += outcome.cost.wall
        self.memory = max(self.memory, outcome.cost.memory)


def main() -> int:
    """Run all programs on damaged files and print the table; return 1 where a peer keeps a message that ours loses."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--files", type=int, default=200, help="damaged files (default 200)")
    parser.add_argument("--first", type=int, default=0, help="seed of the first one (default 0)")
    parser.add_argument("--pymcap-cli", default=str(Path(sys.executable).with_name("pymcap-cli")), help="the program")
    parser.add_argument("--verbose", action="store_true", help="print a line for each file")
    args = parser.parse_args()
    pymcap = shutil.which(args.pymcap_cli) or ""
    totals: Dict[Tuple[str, str], Totals] = {}
    worse = 0
    with tempfile.TemporaryDirectory(prefix="bench_recover.") as name:
        folder = Path(name)
        for seed in range(args.first, args.first + args.files):
            dice = random.Random(seed)
            form, kind = FORMS[seed % len(FORMS)], DAMAGES[seed // len(FORMS) % len(DAMAGES)]
            suffix, _, codec = form.partition(" ")
            samples = state_log(SECONDS, seed=seed)
            source = folder / ("%s %s %d.%s" % (codec, kind, seed, suffix)).replace(" ", "_")
            write = write_bag if suffix == "bag" else write_mcap
            write(source, samples, codec, dice.choice((20000, 200000, 1 << 20)))
            whole: CounterOf[Key] = Counter((s.connection.topic, s.time, s.data) for s in samples)
            source.write_bytes(damaged(source.read_bytes(), kind, dice))
            outcomes = {program: recovered(command, source, folder)
                        for program, command in programs(form, pymcap).items()}
            ours = outcomes["jaka_bag recover"].kept
            for program, outcome in outcomes.items():
                totals.setdefault((form, program), Totals()).add(outcome, whole)
                lost = sum(((outcome.kept & whole) - ours).values())
                if lost:
                    worse += 1
                    print("seed %d: %s keeps %d messages that ours loses" % (seed, program, lost))
            if args.verbose:
                print(seed, form, kind, sum(whole.values()), *("%s: %d" % (program, sum((o.kept & whole).values()))
                                                              for program, o in outcomes.items()))
            remove([source])
    print("%d damaged files from seed %d; Python %s, %d cores, load %.1f" % (
        args.files, args.first, sys.version.split()[0], os.cpu_count() or 0, os.getloadavg()[0]))
    print("%-15s %-21s %6s %10s %9s %9s %9s %9s" % (
        "", "", "files", "kept", "altered", "nothing", "s a file", "memory"))
    for (form, program), t in sorted(totals.items(), key=lambda item: FORMS.index(item[0][0])):
        print("%-15s %-21s %6d %9.2f%% %9d %9d %9.2f %6.0f MB" % (
            form, program, t.files, 100 * t.kept / max(t.of, 1), t.altered, t.nothing, t.wall / t.files,
            t.memory / 1e6))
    print("files of which a peer keeps a message that ours loses: %d" % worse)
    return int(worse > 0)


if __name__ == "__main__":
    sys.exit(main())
