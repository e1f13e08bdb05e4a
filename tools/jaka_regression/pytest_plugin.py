"""The pytest plugin for golden logs as tests.

::

    def test_cell(jaka_replay):
        result = jaka_replay("golden.mcap")
        assert result.same, result.summary

The fixture starts a simulated controller, a ROS master and the driver, makes the log's service calls again, records,
compares, and leaves page, JUnit XML and JSON in the report folder: beside the file of ``--junitxml`` where that is
given, else ``jaka_reports`` below pytest's root. It is loaded by its entry point where the package is installed;
elsewhere by ``-p jaka_regression.pytest_plugin``. ``jaka_cell`` runs the cell's own nodes in place
of the log's calls.
"""
import dataclasses
import importlib
import re
import weakref
from pathlib import Path
from typing import TYPE_CHECKING, Any, Callable, Dict, MutableMapping, Optional, Sequence, Tuple, Union

if TYPE_CHECKING:
    from jaka_bag.compare.tolerances import Tolerances

    from .replay import Replay

pytest: Any = importlib.import_module("pytest")  # its types are beyond Python 3.8
_FOLDER = "jaka_reports"
_used: "MutableMapping[Any, Dict[str, Tuple[str, int]]]" = weakref.WeakKeyDictionary()
"""The test, and which of its logs, that each folder of a run is of: names of tests may differ in what no file has."""


def pytest_addoption(parser: Any) -> None:
    """Register the plugin's options."""
    group = parser.getgroup("jaka", "golden logs of JAKA arms")
    group.addoption("--jaka-reports", metavar="FOLDER", help="where reports of jaka_replay and jaka_cell go")
    group.addoption("--jaka-time-scale", type=float, metavar="N",
                    help="run the simulated controllers of jaka_replay N times faster, at most 10, where logs allow it")
    group.addoption("--jaka-update", action="store_true",
                    help="put what jaka_replay or jaka_cell recorded in the place of a golden log that differs, where "
                         "an unchanged run is the same as the new log")


def report_folder(config: Any) -> Path:
    """Return the folder for the reports of this run."""
    chosen = config.getoption("--jaka-reports", None)
    if chosen:
        return Path(chosen)
    results = config.getoption("xmlpath", None)
    return (Path(results).resolve().parent if results else Path(str(config.rootpath))) / _FOLDER


def file_name(node_id: str) -> str:
    """Make a file name from the name of a test."""
    return re.sub(r"[^A-Za-z0-9_.-]+", "_", node_id).strip("_")


class _Case:
    """The test that uses a fixture: where its files and its reports are, and how many logs it has compared."""

    def __init__(self, request: Any) -> None:
        self._request = request
        self._count = 0
        self.beside = Path(str(request.path)).parent

    def option(self, name: str) -> Any:
        """Return the value of an option of this plugin."""
        return self._request.config.getoption(name, None)

    def next_folder(self) -> Path:
        """Return a folder of its own for the next report."""
        self._count += 1
        node, config = self._request.node.nodeid, self._request.config
        wanted = file_name(node if self._count == 1 else "%s_%d" % (node, self._count))
        used, owner, name, number = _used.setdefault(config, {}), (node, self._count), wanted, 1
        while used.setdefault(name, owner) != owner:
            number += 1
            name = "%s-%d" % (wanted, number)
        return report_folder(config) / name

    def limits(self, tolerances: "Union[str, Path, Tolerances, None]") -> "Optional[Tolerances]":
        """Return tolerances, which may be a file beside the test's."""
        from jaka_bag.compare.tolerances import load_tolerances

        return load_tolerances(self.beside / tolerances) if isinstance(tolerances, (str, Path)) else tolerances


@pytest.fixture  # type: ignore[misc]
def jaka_replay(request: Any) -> "Callable[..., Replay]":
    """Return a function that replays a log: ``jaka_replay(golden, tolerances=None, time_scale=None, driver=None)``.

    A relative path is looked for beside the test's file. ``tolerances`` is a YAML file or a ``Tolerances``;
    ``driver`` are the interpreter's arguments that start another driver than this package's.
    """
    from .command_lines import DRIVER
    from .replay import replay, takes_time_scale
    from .scenario import scenario_of
    from .update import update_golden

    case = _Case(request)

    def run(golden: Union[str, Path], tolerances: "Union[str, Path, Tolerances, None]" = None,
            time_scale: Optional[float] = None, driver: Optional[Sequence[str]] = None) -> "Replay":
        path, limits, folder = case.beside / golden, case.limits(tolerances), case.next_folder()
        wanted = case.option("--jaka-time-scale")
        starts = tuple(driver or DRIVER)
        if time_scale is None:
            time_scale = wanted if wanted and takes_time_scale(path) else 1.0
        result = replay(path, folder, limits, time_scale, driver=starts)
        if not result.same and time_scale == 1.0 and case.option("--jaka-update"):
            said = update_golden(path, result.candidate, folder / "update", lambda new, place: replay(
                new, place, limits, scenario=scenario_of(path), driver=starts))
            result = dataclasses.replace(result, summary="%s\n%s" % (result.summary, said))
        return result

    return run


@pytest.fixture  # type: ignore[misc]
def jaka_cell(request: Any) -> "Callable[..., Replay]":
    """Return a function that runs the cell's own nodes once and compares what the arm does with the golden log.

    ``jaka_cell(launch, golden, arguments=(), tolerances=None, limit_s=None, driver=None)``: ``launch`` is the launch
    file that starts the nodes, ``arguments`` are its arguments, as ``["driver:=false"]``; the rest is as of
    ``run_cell`` and ``jaka_replay``.
    """
    from .cell.run import run_cell
    from .command_lines import DRIVER
    from .scenario import scenario_of
    from .update import update_golden

    case = _Case(request)

    def run(launch: Union[str, Path], golden: Union[str, Path], arguments: Sequence[str] = (),
            tolerances: "Union[str, Path, Tolerances, None]" = None, limit_s: Optional[float] = None,
            driver: Optional[Sequence[str]] = None) -> "Replay":
        path, limits, folder = case.beside / golden, case.limits(tolerances), case.next_folder()

        def once(log: Path, place: Path) -> "Replay":
            return run_cell(case.beside / launch, log, place, arguments, limits, limit_s, scenario_of(path),
                            tuple(driver or DRIVER))

        result = once(path, folder)
        if not result.same and case.option("--jaka-update"):
            said = update_golden(path, result.candidate, folder / "update", once)
            result = dataclasses.replace(result, summary="%s\n%s" % (result.summary, said))
        return result

    return run
