"""Fifty triggers of each kind on a black box: the content of each file, and its losses (there may be none).

Poses carry their number, and the recorder numbers the messages of every topic: a number that is skipped is a loss.
In the devel space; it takes minutes:

    build/venv/bin/python3 test/soak/soak_black_box.py [TRIGGERS]        of each kind, 50
"""
import os
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / folder) for folder in (".", "test/support", "test/support/live", "test/support/logs")]

from accidents import KINDS, Driver, account_of, black_box, files_of, set_off  # noqa: E402
from ros_graph import Graph  # noqa: E402
from waiting import wait_until  # noqa: E402

BEFORE_S, AFTER_S = 1.0, 0.25


def run(graph, kind, count):
    """Run one row of the table: so many triggers of one kind."""
    with black_box(graph, before="%gs" % BEFORE_S, after="%gs" % AFTER_S) as box, \
            graph.publisher("/jaka_driver") as publisher:
        driver = Driver(publisher)
        wait_until(lambda: driver.sent_at and driver.sent_at[-1] - driver.sent_at[0] > BEFORE_S, "the memory is full")
        for number in range(count):
            set_off(kind, driver, box, graph)
            wait_until(lambda n=number: box.output.count("wrote ") > n, "file %d of %s" % (number + 1, kind))
        sent = driver.sent
        driver.close()
    files = files_of(graph)
    accounts = [account_of(path) for path in files]
    for path in files:
        path.unlink()
    assert all(account.triggers[0]["kind"] == kind for account in accounts)
    print("%-15s %9d %6d %9d %9d %5d %9.3f s %8.3f s" % (
        kind, sum(len(account.triggers) for account in accounts), len(accounts), sent,
        sum(len(account.messages) for account in accounts), sum(account.lost for account in accounts),
        min(account.before_s for account in accounts), min(account.after_s for account in accounts)), flush=True)
    return len(accounts) == count and not any(account.lost for account in accounts)


def main(count):
    print("load average %.2f; window %g s before, %g s after" % (os.getloadavg()[0], BEFORE_S, AFTER_S))
    print("%-15s %9s %6s %9s %9s %5s %11s %10s" % ("kind", "triggers", "files", "poses", "in files", "lost", "before",
                                                   "after"))
    with tempfile.TemporaryDirectory() as folder, Graph(Path(folder)) as graph:
        done = [run(graph, kind, count) for kind in KINDS]
    sys.exit(0 if all(done) else 1)


if __name__ == "__main__":
    main(int((sys.argv[1:] or ["50"])[0]))
