"""A trial of mutants that are made from the source, each against the tests that run its line.

pytest and what the tests import from elsewhere are loaded once; each mutant is a child of that process, in a copy of
the checkout, and ends at its first failing test. Verdicts are kept in ``build/`` as they come: a run that was stopped
goes on where it was, and on a changed checkout the test that killed a mutant before is the first to try it.
"""
import collections
import contextlib
import hashlib
import importlib
import json
import os
import queue
import re
import resource
import signal
import sys
import tempfile
import time
from pathlib import Path
from typing import Any, Dict, Iterator, List, Mapping, NamedTuple, Optional, Sequence, TextIO, Tuple

import line_tests
import mutate
import pytest
import yaml
from source_mutants import SourceMutant, of_rooms, sample

EQUIVALENT = Path(__file__).with_name("equivalent.yaml")
"""Mutants that no test can distinguish from the code, by their key, with the reason."""
KEPT = mutate.ROOT / "build" / "mutation" / "verdicts.jsonl"
_STATE_OF = ("jaka_msgs", "jaka_ros_driver", "test", "tools")
LONGEST_TESTS_S = 120.0
"""Time limit for the tests of a line together, s; the fastest ones are taken."""
_LEAST_S, _SLOWER, _WAITS = 20.0, 4.0, 2.0
"""A mutant's tests may take 20 s of a processor and four times as long as without it, and twice that while they wait;
then the mutant counts as noticed."""
_LOADED_FIRST = ("numpy", "yaml", "hypothesis", "aiohttp", "rospy", "actionlib", "actionlib_msgs.msg",
                 "control_msgs.msg", "diagnostic_msgs.msg", "diagnostic_updater", "geometry_msgs.msg", "jaka_msgs.msg",
                 "jaka_msgs.srv", "roslaunch", "sensor_msgs.msg", "std_srvs.srv", "trajectory_msgs.msg")
_FILE_S = 40.0
"""Time assumed for a file of slow tests that were not measured, s."""
_TEST_S = 40.0
_OPTIONS = ("-q", "-x", "--tb=no", "-rfE", "-p", "no:cacheprovider", "-W", "ignore", "-o", "timeout=%g" % _TEST_S)
_OK, _FAILED, _WRONG_USAGE, _NO_TESTS = 0, 1, (4, 5), 5
_CONFTEST = "ImportError while loading conftest"
_FIRST_FILES = 2


class Tried(NamedTuple):
    """The outcome of one mutant.

    Attributes:
        mutant: The mutant.
        by: The test that noticed it, or what happened instead; "" where it lives.
        tests: How many tests were to run.
        took: s.
    """

    mutant: SourceMutant
    by: str
    tests: int
    took: float


class _Order:
    """A plugin of pytest that runs these tests only, in this order."""

    def __init__(self, tests: Sequence[str]) -> None:
        self._places = {test: place for place, test in enumerate(tests)}
        self.failed = ""

    @pytest.hookimpl(trylast=True)
    def pytest_collection_modifyitems(self, items: List[pytest.Item]) -> None:
        items[:] = sorted((item for item in items if self._place(item) is not None), key=self._place)

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if report.failed:
            self.failed = self.failed or report.nodeid

    def _place(self, item: pytest.Item) -> Optional[int]:
        return self._places.get(item.nodeid, self._places.get(mutate.file_of(item.nodeid)))


class _Child:
    """A run of one mutant's tests in a copy of the checkout."""

    def __init__(self, folder: Path, mutant: SourceMutant, tests: Sequence[str], limit: float, killer: str) -> None:
        self.folder, self.mutant, self._tests = folder, mutant, tests
        self._path = folder / "jaka_ros_driver" / mutant.file
        self._original = self._path.read_bytes()
        self._output: TextIO = tempfile.TemporaryFile("w+")
        self._began = time.monotonic()
        self._ends = self._began + _WAITS * limit
        if tests:
            _write(self._path, mutant.applied(self._original))
            self._process = _forked(folder, tests, self._output, limit, killer)

    def ended(self) -> Optional[Tried]:
        """Return the outcome; None while its tests run."""
        if not self._tests:
            return self._tried("")
        process, status = os.waitpid(self._process, os.WNOHANG)
        if process:
            return self._tried(self._failure(status))
        if time.monotonic() < self._ends:
            return None
        self.stop()
        return self._tried("its time limit of %.0f s" % (self._ends - self._began))

    def stop(self) -> None:
        """End its tests, and whatever they have started."""
        if self._tests:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(self._process, signal.SIGKILL)
            with contextlib.suppress(ChildProcessError):
                os.waitpid(self._process, 0)

    def _failure(self, status: int) -> str:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(self._process, signal.SIGKILL)  # what the tests have left behind
        if os.WIFSIGNALED(status):
            return "signal %d" % os.WTERMSIG(status)
        code = os.WEXITSTATUS(status)
        if code == _OK:
            return ""
        self._output.seek(0)
        said = self._output.read()
        failed = re.findall(r"^(?:FAILED|ERROR) (.*?)(?: - .*)?$", said, re.MULTILINE)
        if _CONFTEST in said:
            return "a conftest.py, which cannot be imported"
        if code in _WRONG_USAGE:
            raise mutate.CannotTell("pytest ended with %d: %s" % (code, said[-2000:]))
        if not failed:
            return "the process, which ended with %d" % code
        return str(failed[-1])

    def _tried(self, by: str) -> Tried:
        _write(self._path, self._original)
        self._output.close()
        return Tried(self.mutant, by, len(self._tests), time.monotonic() - self._began)


_moment = [int(time.time()) - 10_000_000]


def _write(path: Path, content: bytes) -> None:
    """Write a module under a time that it never had: Python compares the times of compiled files in whole seconds."""
    path.write_bytes(content)
    _moment[0] += 1
    os.utime(str(path), (_moment[0], _moment[0]))


def _run(tests: Sequence[str]) -> int:
    """Run these tests until one fails twice, since what fails once has perhaps waited for a busy machine; return
    pytest's code."""
    while tests:
        order = _Order(tests)
        files = sorted({mutate.file_of(test) for test in tests})
        code = int(pytest.main([*_OPTIONS, *files], plugins=[order]))
        if code != _FAILED or not order.failed:
            return code
        print("\nagain: " + order.failed)
        again = int(pytest.main([*_OPTIONS, mutate.file_of(order.failed)], plugins=[_Order([order.failed])]))
        if again or order.failed not in tests:
            return again
        tests = tests[list(tests).index(order.failed) + 1:]
    return _OK


def _forked(folder: Path, tests: Sequence[str], output: TextIO, limit: float, killer: str) -> int:
    sys.stdout.flush()
    process = os.fork()
    if process:
        return process
    code = 70
    try:
        os.setsid()
        signal.signal(signal.SIGTERM, signal.SIG_DFL)
        os.chdir(str(folder))
        os.dup2(output.fileno(), 1)
        os.dup2(output.fileno(), 2)
        sys.dont_write_bytecode = False  # a copy is compiled once, not for each mutant
        sys.path[:] = [place for place in sys.path if not place.startswith(str(mutate.ROOT / "test"))]
        for name in ("line_tests", "mutate", "mutant", "mutants", "source_mutants", "generated"):
            sys.modules.pop(name, None)
        resource.setrlimit(resource.RLIMIT_CPU, (int(limit), int(limit) + 5))
        result = _run([killer]) if killer else _OK
        if result in (_OK, _NO_TESTS):
            for part in parts(tests):
                result = _run(part)
                if result:
                    break
        code = result  # not before: a mutant may end the process by what it raises
    finally:
        sys.stdout.flush()
        os._exit(code)


def parts(tests: Sequence[str]) -> List[List[str]]:
    """Split these tests: first those of the files with the most of them; to load all files takes seconds."""
    counts = collections.Counter(mutate.file_of(test) for test in tests)
    first = [file for file, _ in counts.most_common(_FIRST_FILES)]
    halves: List[List[str]] = [[], []]
    for test in tests:
        halves[mutate.file_of(test) not in first].append(test)
    return [half for half in halves if half]


def load_first() -> None:
    """Import what the tests need from elsewhere, so that no child has to."""
    for name in _LOADED_FIRST:
        with contextlib.suppress(ImportError):
            importlib.import_module(name)
    ours = [name for name in sys.modules if name.split(".")[0] in ("jaka_ros_driver", "jaka_bag", "import_graph")]
    for name in ours:
        del sys.modules[name]


def chosen_tests(known: line_tests.LineTests, mutant: SourceMutant, root: Path) -> Tuple[List[str], float]:
    """Return the tests that a mutant is tried with, and how long they take without it, s."""
    tests: List[str] = []
    total = 0.0
    for test in known.of(mutant, root):
        takes = known.seconds.get(test)
        if tests and takes is not None and total + takes > LONGEST_TESTS_S:
            continue
        tests.append(test)
        total += _FILE_S if takes is None else takes
    return tests, total


def tried(mutants: Sequence[SourceMutant], known: line_tests.LineTests, free: "queue.Queue[Path]",
          killers: Mapping[str, str]) -> Iterator[Tried]:
    """Try each of the mutants, one at a time in each copy of the checkout; yield the outcomes as they end.

    ``killers`` are tests that have noticed mutants before, by the mutant's key; they are tried first.
    """
    waiting = collections.deque(mutants)
    running: List[_Child] = []
    try:
        while waiting or running:
            while waiting and not free.empty():
                mutant, folder = waiting.popleft(), free.get()
                tests, seconds = chosen_tests(known, mutant, folder)
                killer = killers.get(mutant.key, "")
                if not (tests and (folder / mutate.file_of(killer)).is_file()):  # it was a time limit, say
                    killer = ""
                running.append(_Child(folder, mutant, tests, _LEAST_S + _SLOWER * seconds, killer))
            for child in list(running):
                result = child.ended()
                if result is not None:
                    running.remove(child)
                    free.put(child.folder)
                    yield result
            time.sleep(0.01)
    finally:
        for child in running:
            child.stop()


class Verdicts:
    """The outcomes of mutants in earlier runs, one JSON object a line: of this state of the checkout, and of others.

    Attributes:
        known: Of this state, by the mutant's key: who noticed it, how many tests there were, and how long it took, s.
        killers: Who noticed a mutant last, of whatever state, by the mutant's key.
    """

    def __init__(self, path: Path, state: str) -> None:
        self.known: Dict[str, Tuple[str, int, float]] = {}
        self.killers: Dict[str, str] = {}
        self._path, self._state = path, state
        for line in path.read_text(encoding="utf-8").splitlines() if path.exists() else ():
            row = json.loads(line)
            if row["by"]:
                self.killers[row["mutant"]] = row["by"]
            if row["state"] == state:
                self.known[row["mutant"]] = row["by"], row["tests"], row["took"]

    def is_known(self, mutant: SourceMutant, tests: int) -> bool:
        """Return whether it was killed in this state, or has outlived at least so many tests."""
        by, outlived, _ = self.known.get(mutant.key, ("", -1, 0.0))
        return bool(by) or outlived >= tests

    def add(self, one: Tried) -> None:
        """Keep a verdict, so that a run which is stopped now has it."""
        row = {"state": self._state, "mutant": one.mutant.key, "by": one.by, "tests": one.tests,
               "took": round(one.took, 2)}
        self._path.parent.mkdir(parents=True, exist_ok=True)
        with self._path.open("a", encoding="utf-8") as file:
            file.write(json.dumps(row) + "\n")


def state_of(root: Path) -> str:
    """Compute a name for what decides about mutants in a checkout: code and tests without what makes the mutants."""
    mark = hashlib.sha256()
    for path in sorted(path for name in _STATE_OF for path in (root / name).rglob("*")):
        name = path.relative_to(root).as_posix()
        if path.is_file() and not name.startswith("test/mutation/") and "__pycache__" not in name:
            mark.update(b"%s %d " % (name.encode(), path.stat().st_size) + path.read_bytes())
    return mark.hexdigest()[:16]


def equivalents() -> Dict[str, str]:
    """Return the reason of each mutant that no test can notice, by the mutant's key."""
    rows: List[Dict[str, Any]] = yaml.safe_load(EQUIVALENT.read_text(encoding="utf-8")) or []
    return {" | ".join(row["mutant"]): row["why"] for row in rows}


def report(count: int, seed: int, jobs: int, only: Sequence[str]) -> int:
    """Print what lives of so many mutants, and the share that was noticed; return 1 where one lives that is not
    listed."""
    began = time.monotonic()
    listed = equivalents()
    with mutate.copies(jobs) as free:
        root = free.queue[0]  # the checkout may change meanwhile
        verdicts = Verdicts(KEPT, state_of(root))
        every = list(of_rooms(root / line_tests.PACKAGE.name))
        chosen = sample(root / line_tests.PACKAGE.name,
                        [one for one in every if not only or any(text in one.key for text in only)], count, seed)
        known = line_tests.known(root, jobs)
        load_first()
        wanted = [mutant for mutant in chosen if mutant.key not in listed]
        results = [Tried(mutant, *verdicts.known[mutant.key]) for mutant in wanted if verdicts.is_known(
            mutant, len(chosen_tests(known, mutant, root)[0]))]
        done = {one.mutant for one in results}
        print("%d of %d mutants, seed %d; %d are known of this state" % (len(chosen), len(every), seed, len(results)),
              flush=True)
        for one in results:
            _show(one)
        for one in tried([mutant for mutant in wanted if mutant not in done], known, free, verdicts.killers):
            verdicts.add(one)
            results.append(one)
            _show(one)
    alive = [one for one in results if not one.by]
    for room, rows in sorted(_by_room(results).items()):
        killed = sum(bool(one.by) for one in rows)
        print("%-12s %4d tried, %4d killed, %5.1f %%" % (room, len(rows), killed, 100.0 * killed / len(rows)))
    for key in sorted(set(listed) - {one.key for one in every}):
        print("listed as equivalent, and not there any more: " + key)
    print("seed %d: %d mutants, %d listed as equivalent, %d killed, %d alive: %.1f %% killed; %.0f s, %.1f s each" % (
        seed, len(chosen), len(chosen) - len(results), len(results) - len(alive), len(alive),
        100.0 * (len(results) - len(alive)) / max(1, len(chosen)), time.monotonic() - began,
        sum(one.took for one in results) / max(1, len(results))))
    return 1 if alive else 0


def _show(one: Tried) -> None:
    if not one.by:
        print(_row(one), flush=True)
    elif os.environ.get("MUTATE_SHOW"):
        print("killed %4.1f s  %s  by %s" % (one.took, one.mutant.key, one.by), flush=True)


def _row(one: Tried) -> str:
    mutant = one.mutant
    return "ALIVE  jaka_ros_driver/%s:%d  %s, in %s; %d tests run the line\n    - %s\n    + %s\n    key: %s" % (
        mutant.file, mutant.line, mutant.kind, mutant.scope or "the module", one.tests, mutant.code, mutant.changed,
        mutant.key)


def _by_room(results: Sequence[Tried]) -> Dict[str, List[Tried]]:
    rooms: Dict[str, List[Tried]] = {}
    for one in results:
        rooms.setdefault(one.mutant.file.split("/")[0], []).append(one)
    return rooms
