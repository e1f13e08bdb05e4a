"""Trial of the tests: applies the mutants of ``mutants.py`` one at a time, and runs the tests that should fail.

Every mutant is applied to a copy of the checkout in a temporary folder, never to the checkout itself. A mutant that no
test notices is a gap in the tests. The tests must pass in the copy before anything is changed there.
"""
import argparse
import contextlib
import os
import queue
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Callable, Dict, Iterator, List, NamedTuple, Sequence, Tuple, TypeVar

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(Path(__file__).resolve().parent))

from mutant import Mutant, mutated, path_of  # noqa: E402
from mutants import MUTANTS  # noqa: E402

NOT_COPIED = ("build", "devel", "install", "__pycache__", "*.pyc", ".*_cache", ".git", ".hypothesis", "*.egg-info",
              "jaka_reports")
TIME_LIMIT_S = 120.0
"""Time limit, s, after which a mutant counts as noticed: the time limits of the tests would fail."""
_SLOWER = 4.0
"""A mutant's tests may take so many times as long as they did without it, where that is more."""
TESTS_FAILED = 1
NOT_COLLECTED = 2
_LONGEST_SHOWN = 120

T = TypeVar("T")
R = TypeVar("R")


class Verdict(NamedTuple):
    """The tests' verdict on one mutant.

    Attributes:
        is_killed: A test failed, or the time was over.
        by: The test, or what happened instead.
        took: s.
    """

    is_killed: bool
    by: str
    took: float


class CannotTell(Exception):
    """A failure of the tests to run, so that they prove nothing about a mutant."""


def run_tests(folder: Path, tests: Sequence[str], time_limit: float = TIME_LIMIT_S) -> Verdict:
    """Run these tests in a copy of the checkout until the first one fails; a mutant is killed where one fails or does
    not end.

    Raises CannotTell where there are no such tests.
    """
    command = [sys.executable, "-m", "pytest", "-q", "-x", "--tb=no", "-rfE", "-p", "no:cacheprovider", *tests]
    # Python compares the times of compiled files in whole seconds: mutants come faster.
    environment = dict(os.environ, PYTHONDONTWRITEBYTECODE="1", COLUMNS="200")
    began = time.monotonic()
    with tempfile.TemporaryFile("w+") as output:
        process = subprocess.Popen(command, cwd=str(folder), env=environment, stdin=subprocess.DEVNULL, stdout=output,
                                   stderr=subprocess.STDOUT, start_new_session=True)
        try:
            process.wait(time_limit)
        except subprocess.TimeoutExpired:
            return Verdict(True, "its time limit of %.0f s" % time_limit, time.monotonic() - began)
        finally:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
            process.wait()
        output.seek(0)
        lines = output.read().splitlines()
    took = time.monotonic() - began
    if process.returncode == 0:
        return Verdict(False, "", took)
    failed = [line.split(" ", 1)[1].split(" - ")[0] for line in lines if line.startswith(("FAILED ", "ERROR "))]
    if process.returncode not in (TESTS_FAILED, NOT_COLLECTED) or not failed:
        raise CannotTell("pytest %s: %s" % (" ".join(tests), "\n".join(lines[-5:])))
    return Verdict(True, failed[0], took)


def try_mutant(folder: Path, mutant: Mutant, time_limit: float = TIME_LIMIT_S) -> Verdict:
    """Apply a mutant in a copy of the checkout, run its tests there, and undo it."""
    path = path_of(folder, mutant)
    original = path.read_text(encoding="utf-8")
    path.write_text(mutated(mutant, original), encoding="utf-8")
    try:
        return run_tests(folder, mutant.tests, time_limit)
    finally:
        path.write_text(original, encoding="utf-8")


@contextlib.contextmanager
def copies(count: int) -> Iterator["queue.Queue[Path]"]:
    """Make so many copies of the checkout, in a temporary folder."""
    with tempfile.TemporaryDirectory(prefix="mutants") as parent:
        free: queue.Queue[Path] = queue.Queue()
        for number in range(count):
            folder = Path(parent, str(number))
            shutil.copytree(str(ROOT), str(folder), symlinks=True, ignore=shutil.ignore_patterns(*NOT_COPIED))
            free.put(folder)
        yield free


def in_copies(jobs: int, work: Callable[[Path, T], R], items: Sequence[T]) -> Iterator[R]:
    """Return the results of ``work`` on the items, in their order; so many at a time, each in a copy of its own."""
    with copies(jobs) as free, ThreadPoolExecutor(jobs) as pool:
        def run(item: T) -> R:
            folder = free.get()
            try:
                return work(folder, item)
            finally:
                free.put(folder)

        futures = [pool.submit(run, item) for item in items]
        try:
            for future in futures:
                yield future.result()
        finally:
            for future in futures:
                future.cancel()


def file_of(test: str) -> str:
    """Return the file or folder of an argument of pytest."""
    return test.split("::")[0]


def time_without(jobs: int, mutants: Sequence[Mutant]) -> Dict[str, float]:
    """Run all the tests of these mutants without any of them; return how long each file took, s.

    Raises CannotTell where one fails.
    """
    files: Dict[str, List[str]] = {}
    for test in sorted({test for mutant in mutants for test in mutant.tests}):
        files.setdefault(file_of(test), []).append(test)
    verdicts = list(in_copies(jobs, lambda folder, tests: run_tests(folder, tests, 5 * TIME_LIMIT_S),
                              list(files.values())))
    failed = [verdict.by for verdict in verdicts if verdict.is_killed]
    if failed:
        raise CannotTell("without a mutant these fail: " + ", ".join(failed))
    return {name: verdict.took for name, verdict in zip(files, verdicts)}


def time_limit(mutant: Mutant, times: Dict[str, float]) -> float:
    """Return how long a mutant's tests may take, s."""
    return max(TIME_LIMIT_S, _SLOWER * sum(times[name] for name in {file_of(test) for test in mutant.tests}))


def chosen(names: Sequence[str]) -> Tuple[Mutant, ...]:
    """Return the mutants in whose name or file one of these texts stands; all without texts."""
    return tuple(mutant for mutant in MUTANTS
                 if not names or any(name in mutant.name or name in mutant.file for name in names))


def main() -> int:
    """Print a row for each mutant; return 1 where one is alive, 2 where the tests fail without any."""
    parser = argparse.ArgumentParser(prog="tools/dev mutate", description="Do the tests notice seeded defects?")
    parser.add_argument("--only", metavar="NAME", action="append", default=[],
                        help="mutants in whose name or file this text stands; may be repeated")
    parser.add_argument("--jobs", metavar="J", type=int, default=max(1, min(4, os.cpu_count() or 1)),
                        help="mutants at a time (default %(default)s)")
    parser.add_argument("--generated", metavar="N", type=int, default=0,
                        help="so many mutants made from the source in place of the listed ones")
    parser.add_argument("--seed", metavar="S", type=int, default=1, help="which of them (default %(default)s)")
    options = parser.parse_args()
    mutants = chosen(options.only)
    if options.jobs < 1:
        parser.error("--jobs must be 1 or more")
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(128 + signal.SIGTERM))  # so that the copies are removed
    try:
        if options.generated:
            import generated  # which needs the functions of this module

            return generated.report(options.generated, options.seed, options.jobs, options.only)
        if not mutants:
            parser.error("no mutant is called so")
        return report(mutants, options.jobs)
    except CannotTell as error:
        print(error, file=sys.stderr)
        return 2


def report(mutants: Sequence[Mutant], jobs: int) -> int:
    """Print a row for each of these mutants; return 1 where one is alive."""
    began = time.monotonic()
    times = time_without(jobs, mutants)
    widths = [max(len(row) for row in column) for column in zip(*((m.name, m.file) for m in mutants))]
    alive = 0
    for mutant, verdict in zip(mutants, in_copies(
            jobs, lambda folder, one: try_mutant(folder, one, time_limit(one, times)), mutants)):
        alive += not verdict.is_killed
        print("%-*s  %-*s  %s" % (widths[0], mutant.name, widths[1], mutant.file,
                                  verdict.by[:_LONGEST_SHOWN] if verdict.is_killed else "ALIVE"), flush=True)
    print("%d mutants, %d killed, %d alive, %.0f s" % (len(mutants), len(mutants) - alive, alive,
                                                      time.monotonic() - began))
    return 1 if alive else 0


if __name__ == "__main__":
    sys.modules["mutate"] = sys.modules["__main__"]
    sys.exit(main())
