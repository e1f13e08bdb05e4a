"""The tests that run a line: recorded with coverage, file of tests by file of tests, and kept in ``build/``.

A file of tests is recorded again when it, or a module of which it runs a line, has changed. As an executable:
``OUT FILE...`` records one run of pytest over these files into OUT; that is done in processes of their own.
"""
import functools
import hashlib
import json
import re
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor, as_completed
from pathlib import Path
from typing import Any, Dict, Iterable, List, NamedTuple, Sequence, Set, Tuple

import pytest
from source_mutants import ROOMS, SourceMutant

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = ROOT / "jaka_ros_driver"
KEPT = ROOT / "build" / "mutation" / "lines.json"
RECORDED = ("test/client", "test/kinematics", "test/trajectory", "test/custody/test_seeds.py", "test/ros")
_SEEDS = re.compile(r"test_no_seed_breaks_a_rule\[(\d+)\]")
_SLOW = ("test/ros/pages/", "test/ros/panel", "test/trajectory/test_planner.py", "test/kinematics/test_oracle.py")
LIVE: Dict[str, Tuple[str, ...]] = {
    "client/arm_stopper.py": ("test/client/guard/test_guard.py",),
    "client/driver_pipe.py": ("test/client/guard/test_guard.py",),
    "client/guard.py": ("test/client/guard/test_guard.py",),
    "client/guard_post.py": ("test/client/guard/test_guard.py",),
    "client/guard_process.py": ("test/client/guard/test_guard.py",),
    "ros/action_server.py": ("test/ros/services/test_action_server.py",),
    "ros/connections.py": ("test/ros/test_connections.py",),
    "ros/convert.py": ("test/ros/services/test_services.py", "test/ros/topics/test_publishing.py"),
    "ros/log_bridge.py": ("test/ros/test_log_bridge.py",),
    "ros/master_watch.py": ("test/ros/test_master_restart.py",),
    "ros/metrics/figures.py": ("test/ros/metrics/test_metrics_live.py",),
    "ros/node.py": ("test/ros/test_node.py", "test/ros/services/test_stop.py"),
    "ros/other_messages.py": ("test/ros/test_external_messages.py",),
    "ros/services/call_publisher.py": ("test/ros/services/test_services.py",),
    "ros/services/gripper_action.py": ("test/ros/services/test_gripper_live.py",),
    "ros/services/path_action.py": ("test/ros/paths/test_move_path.py",),
    "ros/services/recover_action.py": ("test/ros/services/test_recover_action.py",),
    "ros/services/handlers.py": ("test/ros/services/test_services.py",),
    "ros/services/server.py": ("test/ros/services/test_services.py", "test/ros/test_connections.py"),
    "ros/services/table.py": ("test/ros/services/test_services.py",),
    "ros/single_name.py": ("test/ros/start/test_single_name.py",),
    "ros/topics/diagnostics.py": ("test/ros/topics/test_diagnostics.py",),
    "ros/topics/motion_ends.py": ("test/ros/test_completion.py", "test/ros/paths/test_queue.py"),
    "ros/topics/robot_status.py": ("test/ros/topics/test_robot_status.py",),
    "ros/topics/servo_topics.py": ("test/ros/topics/test_servo_live.py",),
    "ros/topics/speed.py": ("test/ros/topics/test_publishing.py",),
    "ros/topics/stamps.py": ("test/ros/topics/test_publishing.py",),
    "ros/topics/velocity.py": ("test/ros/topics/test_publishing.py",),
    "ros/trajectories/controller_manager.py": ("test/ros/trajectories/test_controller_manager.py",),
    "ros/trajectories/query.py": ("test/ros/trajectories/test_controller_manager.py",),
    "ros/trajectories/topics.py": ("test/ros/trajectories/test_goals.py",),
}
"""Tests that notice a mutant of a line that is run in processes of their own only, beside a ROS master."""
_FAST_S, _OWN_S = 0.5, 2.0
_CHUNKS_OF_SEEDS = 3
"""Chunks of ten seeds each."""
_FILES_A_PROCESS = 12
"""Files of tests that one process records: few, so that a stopped recording loses little; more than one, for speed."""


class LineTests(NamedTuple):
    """The tests by the lines that they run.

    Attributes:
        seconds: How long each test takes, by its pytest id.
        lines: Which tests run a line, by the file below the package, then by the line.
    """

    seconds: Dict[str, float]
    lines: Dict[str, Dict[int, Set[str]]]

    def of(self, mutant: SourceMutant, root: Path = ROOT) -> List[str]:
        """Return the tests that may notice a mutant: fast ones of its module, then the fastest first.

        Last come whole files of slow tests. ``root`` is the checkout that the mutant was made from.
        """
        lines = self.lines.get(mutant.file, {})
        found = self._at(lines, mutant.lines)
        if not mutant.lines:  # run at import; it is noticed where its name is used, or anywhere in its file
            name = re.match(r"(\w+)", mutant.code)
            found = self._at(lines, lines)
            if name:
                found |= self._users(name.group(1), mutant.file, root / PACKAGE.name)
            module = Path(mutant.file).stem  # a test of a table, say, runs no line of its module
            found |= {test for test, seconds in self.seconds.items()
                      if seconds < _FAST_S and module in _words(root / test.split("::")[0])}
        own = re.compile(r"/test_%s(_\w+)?\.py" % Path(mutant.file).stem)  # the likeliest to notice
        found = found or {test for test in self._at(lines, lines) if own.search(test)}
        ordered = sorted(found, key=lambda test: (not own.search(test) or self.seconds[test] > _OWN_S,
                                                  self.seconds[test], test))
        return ordered + list(LIVE.get(mutant.file, ()))

    @staticmethod
    def _at(lines: Dict[int, Set[str]], numbers: Iterable[int]) -> Set[str]:
        return {test for number in numbers for test in lines.get(number, ())}

    def _users(self, name: str, home: str, package: Path) -> Set[str]:
        """Return the tests of the lines that use a name of a module; a private one is used in its module only."""
        found: Set[str] = set()
        for file, lines in self.lines.items():
            if name.startswith("_") and file != home:
                continue
            found |= self._at(lines, _words(package / file).get(name, ()))
        return found


@functools.lru_cache(maxsize=None)
def _words(path: Path) -> Dict[str, List[int]]:
    """Return the lines of a file in which each word stands."""
    found: Dict[str, List[int]] = {}
    for number, text in enumerate(path.read_text(encoding="utf-8").splitlines(), 1):
        for word in set(re.findall(r"\w+", text)):
            found.setdefault(word, []).append(number)
    return found


class _Recorder:
    """A plugin of pytest that names the context of each test, and leaves out what needs a ROS master or takes long."""

    def __init__(self, measured: Any) -> None:
        self._measured = measured
        self.seconds: Dict[str, float] = {}
        self.failed: List[str] = []

    def pytest_collection_modifyitems(self, items: List[pytest.Item]) -> None:
        items[:] = [item for item in items if "ros_master" not in getattr(item, "fixturenames", ())
                    and not any(int(number) >= _CHUNKS_OF_SEEDS for number in _SEEDS.findall(item.name))]

    @pytest.hookimpl(hookwrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Iterable[None]:
        self._measured.switch_context(item.nodeid)
        yield
        self._measured.switch_context("")

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if report.failed:
            self.failed.append(report.nodeid)
        if report.when == "call" and report.passed or report.when != "call" and report.nodeid in self.seconds:
            self.seconds[report.nodeid] = self.seconds.get(report.nodeid, 0.0) + report.duration


def record(files: Sequence[str]) -> Dict[str, Any]:
    """Run these files of tests in this process; return what is known of each, ready for JSON.

    That is the seconds of each test, and for each line of a module the tests by their place among the seconds.
    """
    import coverage

    measured = coverage.Coverage(data_file=None, include=["%s/%s/*" % (PACKAGE, room) for room in ROOMS],
                                 config_file=False)
    recorder = _Recorder(measured)
    measured.start()
    pytest.main(["-q", "--tb=line", "-p", "no:cacheprovider", *files], plugins=[recorder])
    measured.stop()
    found: Dict[str, Any] = {file: {"seconds": {}, "lines": {}, "failed": []} for file in files}
    for test in recorder.failed:
        found[test.split("::")[0]]["failed"].append(test)
    for test, seconds in recorder.seconds.items():
        if test not in recorder.failed:
            found[test.split("::")[0]]["seconds"][test] = round(seconds, 4)
    numbers = {test: number for one in found.values() for number, test in enumerate(one["seconds"])}
    data = measured.get_data()
    for path in data.measured_files():
        name = Path(path).relative_to(PACKAGE).as_posix()
        for line, tests in data.contexts_by_lineno(path).items():
            for test in tests:
                if test in numbers:
                    lines = found[test.split("::")[0]]["lines"].setdefault(name, {})
                    lines.setdefault(str(line), []).append(numbers[test])
    return found


def _mark(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest() if path.exists() else ""


def _files(root: Path) -> List[str]:
    found = []
    for name in RECORDED:
        path = root / name
        found += [path] if path.is_file() else path.rglob("test_*.py")
    names = sorted(path.relative_to(root).as_posix() for path in found)
    return [name for name in names if not name.startswith(_SLOW)]


def known(root: Path, jobs: int = 1) -> LineTests:
    """Record in a copy of the checkout, so many processes at a time, what has changed; read the rest."""
    kept = read(KEPT) if KEPT.exists() else {}
    files = _files(root)
    stale = [file for file in files if file not in kept or any(
        _mark(root / name) != mark for name, mark in kept[file]["marks"].items())]
    parts = [stale[first:first + _FILES_A_PROCESS] for first in range(0, len(stale), _FILES_A_PROCESS)]
    if stale:
        print("recording which lines %d files of tests run ..." % len(stale), flush=True)
    KEPT.parent.mkdir(parents=True, exist_ok=True)
    with ThreadPoolExecutor(jobs) as pool:
        futures = [pool.submit(_recorded, root, part) for part in parts]
        try:
            for future in as_completed(futures):
                for file, one in future.result().items():
                    _keep(kept, root, file, one)
        finally:
            for future in futures:
                future.cancel()
    return joined(kept[file] for file in files)


def _keep(kept: Dict[str, Any], root: Path, file: str, one: Dict[str, Any]) -> None:
    names = [file, *("%s/%s" % (PACKAGE.name, name) for name in one["lines"])]
    kept[file] = {"marks": {name: _mark(root / name) for name in names}, **one}
    if one["failed"]:
        print("failed without a mutant, and will notice none in this run: " + ", ".join(one["failed"]), flush=True)
        kept[file]["marks"][file] = ""  # it is recorded again in the next run
    new = KEPT.with_suffix(".new")
    new.write_text(json.dumps(kept), encoding="utf-8")
    new.replace(KEPT)


def _recorded(root: Path, files: Sequence[str]) -> Dict[str, Any]:
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder, "lines.json")
        program = root / Path(__file__).relative_to(ROOT)
        subprocess.run([sys.executable, str(program), str(out), *files], cwd=str(root), stdout=subprocess.DEVNULL,
                       check=True)
        return read(out)


def read(path: Path) -> Dict[str, Any]:
    """Return what was recorded into a file."""
    found: Dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    return found


def joined(parts: Iterable[Dict[str, Any]]) -> LineTests:
    """Join the records of several files of tests."""
    known = LineTests({}, {})
    for part in parts:
        known.seconds.update(part["seconds"])
        names = list(part["seconds"])
        for file, lines in part["lines"].items():
            target = known.lines.setdefault(file, {})
            for line, tests in lines.items():
                target.setdefault(int(line), set()).update(names[number] for number in tests)
    return known


def main(arguments: Sequence[str]) -> int:
    """Record files of tests into the file that comes first."""
    Path(arguments[0]).write_text(json.dumps(record(arguments[1:])), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
