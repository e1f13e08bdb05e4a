"""Recording and playing beside Debian's rosbag, in one run: CPU, losses, punctuality, kill -9, a full disk.

Everything is measured on a master of its own, on loopback. Both recorders listen to the same publisher at the same
time; both players take turns. Ratios count, absolute numbers depend on the machine and on who else uses it.

    build/venv/bin/python3 test/benchmark/bench_record_play.py [--help]
"""
import argparse
import contextlib
import os
import random
import signal
import struct
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path
from typing import Dict, List, Sequence, Tuple

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "tools"), str(ROOT / "test" / "support"), str(ROOT / "test" / "support" / "live"),
                str(ROOT / "test" / "support" / "logs")]

import live_samples  # noqa: E402
import numpy as np  # noqa: E402
import ros_graph  # noqa: E402
from mcap.exceptions import EndOfFile  # noqa: E402
from mcap.reader import NonSeekingReader  # noqa: E402

from jaka_bag.live.linux_timing import precise_wakeups  # noqa: E402
from jaka_bag.live.names import NodeNames  # noqa: E402
from jaka_bag.live.publisher import Publisher, frame_of  # noqa: E402

ROSBAG_RECORD = "/usr/lib/rosbag/record"
ROSBAG_PLAY = "/usr/lib/rosbag/play"
BODY = struct.pack("<I", 5) + b"world" + b"\1" * 48


def generate(topics: int, rate: float, seconds: float, subscribers: int) -> None:
    """Publish state-size messages on /t0, /t1 ... by absolute deadlines; runs in a process of its own."""
    publisher = Publisher(NodeNames("/generator"), print, lambda reason: os._exit(0))
    outlets = [publisher.advertise("/t%d" % i, live_samples.twist_connection("/t%d" % i), False) for i in range(topics)]
    ros_graph.with_subscribers(publisher, *outlets, count=subscribers)
    print("go", flush=True)
    with precise_wakeups():
        begin = time.monotonic()
        for number in range(int(rate * seconds)):
            left = begin + number / rate - time.monotonic()
            if left > 0:
                time.sleep(left)
            frame = frame_of(struct.pack("<III", number + 1, *divmod(time.time_ns(), 10 ** 9)) + BODY)
            for outlet in outlets:
                publisher.publish(outlet, frame)
    print("sent", flush=True)
    sys.stdin.readline()
    publisher.close(5.0)


def cpu_s(pid: int) -> float:
    """Return the CPU time of a process so far, s."""
    fields = Path("/proc/%d/stat" % pid).read_text().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def start_generator(graph: ros_graph.Graph, *arguments: object) -> ros_graph.Process:
    return graph.start(sys.executable, __file__, "--generate", *map(str, arguments), stdin=subprocess.PIPE)


def end(generator: ros_graph.Process) -> None:
    """Release a generator that has sent everything."""
    generator.popen.stdin.write("\n")
    generator.popen.stdin.close()
    generator.wait()


def bench_record(graph: ros_graph.Graph, topics: int, rate: float, seconds: float) -> None:
    names = ["/t%d" % i for i in range(topics)]
    recorders = {
        "rosbag record": graph.start(ROSBAG_RECORD, "-O", "peer.bag", *names),
        "rosbag record --lz4": graph.start(ROSBAG_RECORD, "--lz4", "-O", "peer_lz4.bag", *names),
        "jaka_bag record": graph.record("-O", "ours", "--force", "--report", "ours.json", *names),
        "jaka_bag record .bag": graph.record("-O", "ours.bag", "--force", *names),
    }
    generator = start_generator(graph, topics, rate, seconds, len(recorders))
    generator.wait_for_line("go")
    before = {name: cpu_s(process.popen.pid) for name, process in recorders.items()}
    generator.wait_for_line("sent")
    used = {name: cpu_s(process.popen.pid) - before[name] for name, process in recorders.items()}
    for process in recorders.values():
        process.stop()
    end(generator)
    total = topics * int(rate * seconds)
    files = dict(zip(recorders, ("peer.bag", "peer_lz4.bag", "ours.mcap", "ours.bag")))
    base = used["rosbag record"]
    print("\nrecord: %d topics x %g Hz, %g s, %d messages" % (topics, rate, seconds, total))
    print("  %-24s %12s %8s %8s %10s" % ("", "us CPU / msg", "ratio", "lost", "MB"))
    for name, file in files.items():
        path = graph.folder / file
        got = sum(len(found) for found in live_samples.content(path).values())
        print("  %-24s %12.1f %8.2f %8d %10.2f" % (name, used[name] / total * 1e6, used[name] / base, total - got,
                                                  path.stat().st_size / 1e6))
        path.unlink()


def interval_errors(source: Path, played: Path, rate: float) -> "np.ndarray":
    """Return |interval in the log / rate - interval on the wire| of neighbours on each topic, us."""
    logs: List[Dict[str, List[int]]] = []
    for path in (source, played):
        by_topic: Dict[str, List[int]] = {}
        for topic, at in live_samples.times(path):
            by_topic.setdefault(topic, []).append(at)
        logs.append(by_topic)
    errors = []
    for topic, due in logs[0].items():
        came = logs[1].get(topic, [])
        count = min(len(due), len(came))
        errors.append(np.abs(np.diff(due[-count:]) / rate - np.diff(came[-count:])) / 1e3)
    return np.concatenate(errors)


def play_once(graph: ros_graph.Graph, who: str, arguments: Sequence[str]) -> Tuple[float, int]:
    """Play log.bag into a recording with kernel stamps; return CPU s of the player, messages that arrived."""
    meter = graph.record("-O", "meter.mcap", "--force", "/t0", "/t1", "/t2")
    graph.subscribed("/t2")
    options = ["--wait-for-subscribers", "-d", "0.5", *arguments, "log.bag"]
    player = graph.start(ROSBAG_PLAY, *options) if who == "rosbag play" else graph.jaka_bag("play", *options)
    used = 0.0
    while player.popen.poll() is None:
        with contextlib.suppress(FileNotFoundError, IndexError):  # it has just ended
            used = max(used, cpu_s(player.popen.pid))
        threading.Event().wait(0.05)
    player.wait()
    meter.stop()
    return used, sum(len(found) for found in live_samples.content(graph.folder / "meter.mcap").values())


def make_log(graph: ros_graph.Graph, seconds: float) -> int:
    """Make log.bag with 3 topics x 125 Hz; return the number of its messages."""
    recorder = graph.record("-O", "log.bag", "--force", "/t0", "/t1", "/t2")
    generator = start_generator(graph, 3, 125, seconds, 1)
    generator.wait_for_line("sent")
    recorder.stop()
    end(generator)
    return 3 * int(125 * seconds)


def bench_play(graph: ros_graph.Graph, seconds: float, rounds: int) -> None:
    total = make_log(graph, seconds)
    players = ("rosbag play", "jaka_bag play")
    print("\nplay: 3 topics x 125 Hz, %g s, %d messages; |interval error|, us" % (seconds, total))
    print("  %-16s %-8s %8s %8s %8s %9s %8s %7s" % ("", "", "p50", "p90", "p99", "max", "CPU s", "lost"))
    for rate in (1.0, 10.0):
        rows: Dict[str, List[List[float]]] = {name: [] for name in players}
        for _ in range(rounds):
            for name in players:
                used, got = play_once(graph, name, ["-r", "%g" % rate])
                errors = interval_errors(graph.folder / "log.bag", graph.folder / "meter.mcap", rate)
                rows[name].append([float(q) for q in np.percentile(errors, [50, 90, 99, 100])])
                print("  %-16s rate %-3g %8.1f %8.1f %8.1f %9.0f %8.2f %7d"
                      % (name, rate, *rows[name][-1], used, total - got))
        for word, choose in (("best", np.min), ("median", np.median)):
            peer, ours = (choose(np.array(rows[name]), axis=0) for name in players)
            print("  %s of %d rounds, rate %g: p50 %.2f x, p99 %.2f x that of rosbag play"
                  % (word, rounds, rate, ours[0] / peer[0], ours[2] / peer[2]))
    for name in players:
        _, got = play_once(graph, name, ["-i"])
        print("  %-16s unlimited rate: %d of %d arrived" % (name, got, total))


def surviving_stamps(path: Path) -> List[int]:
    """Return send times of the messages in an .mcap that was cut off, ns, as the mcap library reads it."""
    stamps = []
    with open(str(path), "rb") as file, contextlib.suppress(EndOfFile):
        for _, _, message in NonSeekingReader(file, validate_crcs=True).iter_messages(log_time_order=False):
            stamps.append(message.publish_time)
    return stamps


def bench_kills(graph: ros_graph.Graph, kills: int) -> None:
    """Kill recorders of 3 x 125 Hz with kill -9 at random moments."""
    generator = start_generator(graph, 3, 125, 3600, 0)
    generator.wait_for_line("go")
    losses, unreadable, chance = [], 0, random.Random(7)
    path = graph.folder / "killed.mcap.active"
    for _ in range(kills):
        recorder = graph.record("-O", "killed", "/t0", "/t1", "/t2")
        threading.Event().wait(2.0 + 2.0 * chance.random())
        killed_at = time.time_ns()
        recorder.popen.send_signal(signal.SIGKILL)
        recorder.wait()
        stamps = surviving_stamps(path)
        unreadable += not stamps
        losses.append((killed_at - max(stamps, default=0)) / 1e9)
        path.unlink()
    generator.popen.kill()
    generator.wait()
    print("\nkill -9, %d times: unreadable %d, newest message lost before the kill: median %.2f s, worst %.2f s"
          % (kills, unreadable, float(np.median(losses)), max(losses)))


def bench_full_disk(graph: ros_graph.Graph) -> None:
    """Give a recorder of each kind 3 MB of disk, all of which it may use."""
    print("\nfull disk (3 MB)")
    disk = graph.folder / "disk"
    for name in ("rosbag record", "jaka_bag record", "jaka_bag record .bag"):
        disk.mkdir()
        mounted = subprocess.run(["mount", "-t", "tmpfs", "-o", "size=3M", "jaka-bench", str(disk)]).returncode == 0
        if not mounted:
            print("  mounting a small disk is not permitted here")
            disk.rmdir()
            return
        try:
            if name == "rosbag record":
                recorder = graph.start(ROSBAG_RECORD, "-L", "1k", "-O", "disk/log.bag", "/t0", "/t1")
            else:
                suffix = ".bag" if name.endswith(".bag") else ".mcap"
                recorder = graph.record("-L", "0", "--no-compression", "-O", "disk/log" + suffix, "/t0", "/t1")
            generator = start_generator(graph, 2, 5000, 10, 1)
            code = recorder.wait()
            generator.popen.kill()
            generator.wait()
            left = sorted(path.name for path in disk.iterdir())
            whole = [path for path in disk.iterdir() if path.suffix in (".bag", ".mcap")]
            readable = sum(len(found) for path in whole for found in live_samples.content(path).values())
            print("  %-22s exit code %4d, leaves %s, %d messages readable" % (name, code, ", ".join(left), readable))
        finally:
            subprocess.run(["umount", str(disk)], check=True)
            disk.rmdir()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=15.0, help="length of each recording (default 15)")
    parser.add_argument("--rounds", type=int, default=3, help="turns of each player (default 3)")
    parser.add_argument("--kills", type=int, default=10, help="how often to kill -9 (default 10)")
    parser.add_argument("--only", choices=("record", "play", "kill", "disk"), action="append")
    parser.add_argument("--generate", nargs=4, type=float, help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.generate:
        topics, rate, seconds, subscribers = args.generate
        generate(int(topics), rate, seconds, int(subscribers))
        return
    wanted = args.only or ["record", "play", "kill", "disk"]
    with tempfile.TemporaryDirectory(prefix="jaka_bench_") as folder, ros_graph.Graph(Path(folder), True) as graph:
        if "record" in wanted:
            bench_record(graph, 10, 1000.0, args.seconds)
            bench_record(graph, 3, 125.0, args.seconds)
        if "play" in wanted:
            bench_play(graph, args.seconds, args.rounds)
        if "kill" in wanted:
            bench_kills(graph, args.kills)
        if "disk" in wanted:
            bench_full_disk(graph)


if __name__ == "__main__":
    main()
