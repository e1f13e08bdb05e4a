"""A hundred cuts of the links of a running driver, of every kind, and a thousand reconnects: times, and resources held.

Times are those of an outside observer: when the driver reported a lost link, when calls and topics worked again.
Requests are judged by the simulated controller's log. In the devel space; it takes a quarter of an hour:

    build/venv/bin/python3 test/soak/soak_links.py [CUTS [RECONNECTS [SEED [DIALECTS]]]]     100, 1000, seed 1, none

With DIALECTS, so many cuts on each of so many controllers whose dialects are drawn.
"""
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / folder) for folder in (".", "test/support", "test/support/live")]

from drawn_dialects import dialect_options  # noqa: E402
from driver_bench import LiveDriver  # noqa: E402
from figures import summary  # noqa: E402
from link_cuts import CUTS, LinkWatch, size_of  # noqa: E402
from ros_graph import master  # noqa: E402

SHOWN = 10
ALL_KINDS = tuple(sorted(CUTS))


def cut_at_random(cuts, seed, folder, options=("--single-client", "replace"), kinds=ALL_KINDS):
    with LiveDriver(folder, name="linked", simulator=options) as live:
        live.arm.wait_until_ready()
        watch = LinkWatch(live, seed)
        order = [kinds[index % len(kinds)] for index in range(cuts)]
        watch.chance.shuffle(order)
        for name in order:
            watch.cut(name)
        watch.assert_topics_were_sane()
        watch.close()
        code, said = live.end_driver()
        assert code == 0 and "Traceback" not in said, said
        watch.judge(live.verdict())
    print("%d cuts: nothing replayed, nothing energised, nothing resumed, no stale sample" % len(watch.outcomes))
    for name in sorted(CUTS):
        mine = [outcome for outcome in watch.outcomes if outcome.cut == name]
        if mine:
            print("%-26s noticed %s" % (name, summary([outcome.noticed for outcome in mine])))
            print("%-26s usable  %s" % ("", summary([outcome.usable for outcome in mine])))
    for is_silent in (False, True):
        mine = [outcome for outcome in watch.outcomes if CUTS[outcome.cut].is_silent is is_silent]
        print("%-26s noticed %s" % ("all silent" if is_silent else "all others", summary([o.noticed for o in mine])))
    print("%-26s usable  %s" % ("all", summary([o.usable for o in watch.outcomes])), flush=True)


def reconnect(cycles, folder):
    with LiveDriver(folder, name="linked", simulator=("--single-client", "replace")) as live:
        live.arm.wait_until_ready()
        watch = LinkWatch(live, 0)
        sizes = []
        for cycle in range(cycles):
            watch.reconnect(watch.chance.choice(("command", "status", "all")))
            if cycle % max(1, cycles // SHOWN) == 0 or cycle == cycles - 1:
                sizes.append(size_of(live.process.pid))
                print("after %4d reconnects: %3d threads, %3d descriptors, %d kB resident" % ((cycle,) + sizes[-1]),
                      flush=True)
        watch.close()


def main(cuts, cycles, seed, dialects):
    with master(), tempfile.TemporaryDirectory() as folder:
        for number in range(1, dialects + 1):
            options, text = dialect_options(number, folder, frame_bytes=0)  # 2 MB/s are too much for the cuts' proxy
            print(text, flush=True)
            kinds = [name for name in ALL_KINDS if name != "another client" or "second_client replaces" in text]
            cut_at_random(cuts, seed + number, folder, options, kinds)
        if not dialects:
            cut_at_random(cuts, seed, folder)
        if cycles:
            reconnect(cycles, folder)


if __name__ == "__main__":
    main(*map(int, sys.argv[1:] + ["100", "1000", "1", "0"][len(sys.argv) - 1:]))
