"""Logs damaged at random, for a time: each command ends in order, in bounded time and memory, and changes no input.

    build/venv/bin/python3 test/soak/soak_fuzz_logs.py [MINUTES [SEED [FOLDER]]]        60 minutes, seed 1

A damaged log whose run went wrong is kept in FOLDER (``fuzzed`` in the current one), beside the run's output.
Ctrl-C and SIGTERM end it: the process under way does not count, and the exit code is 128 + the signal's number (1 where
something went wrong before).
"""
import contextlib
import faulthandler
import io
import random
import resource
import shutil
import struct
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

TEST = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(TEST / "support" / "logs"), str(TEST / "jaka_bag" / "cli"),
                str(TEST / "jaka_bag" / "containers"), str(TEST.parent / "tools")]

from early_end import EarlyEnd  # noqa: E402
from hostile_logs import HEAVY, HOSTILE, make  # noqa: E402
from log_samples import read, state_log, write  # noqa: E402
from mcap_variants import build, variants  # noqa: E402
from sqlite_logs import write_database  # noqa: E402
from test_foreign_bags import bag_of_version_1_2  # noqa: E402
from test_hostile_logs import MOST_BYTES, MOST_CPU_S  # noqa: E402

from jaka_bag.cli.main import main as jaka_bag  # noqa: E402
from jaka_bag.errors import JakaBagError  # noqa: E402

CASES = 400
"""Cases in one process: the memory of each is measured from the highest so far."""
MOST_SIZE = 100000
PATIENCE_S = 60
NUMBERS = (0, 1, 2, 0x7F, 0xFF, 0x7FFF, 0xFFFF, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF, 1 << 40, (1 << 63) - 1, 1 << 63,
           (1 << 64) - 1)


def seeds(folder):
    """Return whole logs of every kind: (suffix, bytes)."""
    found = []
    for suffix, codecs in ((".bag", ("none", "lz4", "bz2")), (".mcap", ("none", "lz4", "zstd"))):
        for codec in codecs:
            raw = write(folder / (codec + suffix), state_log(0.3), codec).read_bytes()
            found += [(suffix, raw)] * 8
    for _, content, features in variants():
        found.append((".mcap", build(content, features)))
    found += [(".bag", bag_of_version_1_2(state_log(0.3)))] * 8
    found += [(".db3", write_database(folder / "run.db3", state_log(0.3)).read_bytes())] * 24
    light = [name for name in HOSTILE if name not in HEAVY]
    make(folder, light)
    for name in light:
        raw = (folder / name).read_bytes()
        if len(raw) <= MOST_SIZE:
            found.append(("." + name.partition(".")[2], raw))
    return found


def damaged(dice, raw, others):
    """Return a log with one to five damages."""
    data = bytearray(raw)
    for _ in range(dice.choice((1, 1, 1, 2, 3, 5))):
        at = dice.randrange(len(data) or 1)
        width = dice.choice((1, 2, 4, 8))
        kind = dice.randrange(8)
        if kind == 0 and data:
            data[at] ^= 1 << dice.randrange(8)
        elif kind == 1:
            data[at:at + width] = struct.pack("<Q", dice.choice(NUMBERS))[:width]
        elif kind == 2 and at + width <= len(data):
            value = int.from_bytes(data[at:at + width], "little") + dice.choice((-1, 1, -8, 8, 64, -64))
            data[at:at + width] = (value % (1 << 8 * width)).to_bytes(width, "little")
        elif kind == 3:
            del data[at:at + dice.choice((1, 4, 8, 50, 1000))]
        elif kind == 4:
            begin = dice.randrange(len(data) or 1)
            data[at:at] = data[begin:begin + dice.choice((1, 8, 60, 500, 4000))]
        elif kind == 5:
            other = dice.choice(others)[1]
            begin = dice.randrange(len(other))
            data[at:at + 200] = other[begin:begin + 200]
        elif kind == 6:
            del data[at:]
        else:
            data[at:at + width] = bytes(dice.randrange(256) for _ in range(width))
    return bytes(data)


def calls(log, folder, dice):
    """Return the commands on each damaged log: two of all, and to recover it."""
    out = [str(folder / name) for name in ("a.mcap", "b.bag", "ros2", "c.mcap", "d", "e.mcap")]
    one = str(log)
    some = dice.sample([
        ["info", one, "--freq", "--seq"], ["info", one, "--json"], ["doctor", one], ["du", one], ["cat", one],
        ["convert", one, "-o", out[0], "--force"], ["convert", one, "-o", out[1], "--force"],
        ["convert", one, "-o", out[2], "--profile", "ros2", "--force"], ["merge", one, one, "-o", out[0], "--force"],
        ["split", one, "-o", out[3], "--count", "100", "--force"], ["export", one, "-o", out[4], "--force"],
        ["compare", one, one], ["filter", one, "-o", out[0], "-s", "0", "--force"]], 2)
    return some + [["recover", one, out[5], "--force"]]


def run_cases(seed, folder):
    """Run the cases of a seed in one process; anything that is wrong ends it with a traceback."""
    dice = random.Random(seed)
    logs = seeds(folder)
    codes = Counter()
    for _ in range(CASES):
        suffix, raw = dice.choice(logs)
        log = folder / ("case" + suffix)
        case = damaged(dice, raw, logs)
        log.write_bytes(case)
        (folder / "case").write_text(log.name, encoding="utf-8")
        for words in calls(log, folder, dice):
            begin = time.process_time()
            faulthandler.dump_traceback_later(PATIENCE_S, exit=True)
            said = io.TextIOWrapper(io.BytesIO(), encoding="utf-8")
            with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
                code = jaka_bag(words)
            faulthandler.cancel_dump_traceback_later()
            said.seek(0)
            text = said.read()
            most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss << 10
            assert code in (0, 1, 2) and "Traceback" not in text and "\x1b" not in text, (words, code, text[-3000:])
            assert "there is not enough memory" not in text, (words, text[-3000:])
            assert time.process_time() - begin < MOST_CPU_S and most < MOST_BYTES, (words, most >> 20, text[-3000:])
            codes[words[0], code] += 1
            if words[0] == "recover" and code in (0, 1) and Path(words[2]).exists():
                try:
                    read(Path(words[2]))
                except JakaBagError as error:
                    raise AssertionError("what was recovered cannot be read: %s" % error) from error
        assert log.read_bytes() == case
        for left in folder.iterdir():
            if left.is_dir():
                shutil.rmtree(str(left))
            else:
                left.unlink()
    for (name, code), count in sorted(codes.items()):
        print("%s %d %d" % (name, code, count))


def run_process(seed, folder, ended):
    """Run the cases of a seed in a process of its own; return its exit code and outputs, None after an early end."""
    with subprocess.Popen([sys.executable, __file__, "--run", str(seed), folder], stdout=subprocess.PIPE,
                          stderr=subprocess.PIPE, start_new_session=True) as process:  # Ctrl-C is for this one alone
        while True:
            try:
                out, err = process.communicate(timeout=0.5)
                return None if ended.number else (process.returncode, out, err)
            except subprocess.TimeoutExpired:
                if ended.number:
                    process.kill()
                    return None


def main(minutes, seed, kept):
    """Run processes of cases, one after the other, until the time is over; return 1 where something went wrong."""
    ended = EarlyEnd()
    print("from seed %d on" % seed, flush=True)
    end = time.monotonic() + 60.0 * minutes
    codes, cases, wrong = Counter(), 0, 0
    while time.monotonic() < end and not ended.number:
        with tempfile.TemporaryDirectory() as folder:
            done = run_process(seed, folder, ended)
            if done is None:
                break
            code, out, err = done
            if code:
                wrong += 1
                kept.mkdir(exist_ok=True)
                name = Path(folder) / "case"
                log = Path(folder) / (name.read_text(encoding="utf-8") if name.exists() else "none")
                if log.exists():
                    shutil.copy(str(log), str(kept / ("%d_%s" % (seed, log.name))))
                (kept / ("%d.txt" % seed)).write_bytes(out + err)
                print("seed %d: exit code %d, %s" % (
                    seed, code, err.decode("utf-8", "replace").strip()[-500:]), flush=True)
            else:
                cases += CASES
                for line in out.decode().splitlines():
                    name, exit_code, count = line.split()
                    codes[name, exit_code] += int(count)
        seed += 1
    early = "ended early by %s: " % ended.name if ended.number else ""
    print("%s%d damaged logs, %d processes of %d went wrong" % (early, cases, wrong, CASES))
    for (name, code), count in sorted(codes.items()):
        print("  %-8s exit %s %7d" % (name, code, count))
    return 1 if wrong else ended.exit_code if ended.number else 0


if __name__ == "__main__":
    if sys.argv[1:2] == ["--run"]:
        run_cases(int(sys.argv[2]), Path(sys.argv[3]))
    else:
        given = sys.argv[1:] + ["60", "1", "fuzzed"][len(sys.argv) - 1:]
        sys.exit(main(float(given[0]), int(given[1]), Path(given[2])))
