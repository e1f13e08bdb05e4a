"""The pytest plugin for golden logs as tests.

::

    def test_cell(jaka_replay):
        result = jaka_replay("golden.mcap")
        assert result.same, result.summary

The fixture starts a simulated controller, a ROS master and the driver, makes the log's service calls again, records,
compares, and leaves page, JUnit XML and JSON in the report folder: beside the file of ``--junitxml`` where that is
given, else ``jaka_reports`` below pytest's root. It is loaded by its entry point where the package is installed;
elsewhere by ``-p jaka_regression.pytest_plugin``.
"""
import importlib
import re
import shutil
from pathlib import Path
from typing import TYPE_CHECKING, Any, Callable, Optional, Sequence, Union

if TYPE_CHECKING:
    from jaka_bag.compare.tolerances import Tolerances

    from .replay import Replay

pytest: Any = importlib.import_module("pytest")  # its types are beyond Python 3.8
_FOLDER = "jaka_reports"


def pytest_addoption(parser: Any) -> None:
    """Register the plugin's options."""
    group = parser.getgroup("jaka", "golden logs of JAKA arms")
    group.addoption("--jaka-reports", metavar="FOLDER", help="where reports of jaka_replay go")
    group.addoption("--jaka-time-scale", type=float, metavar="N",
                    help="run the simulated controllers of jaka_replay N times faster, at most 10, where logs allow it")
    group.addoption("--jaka-update", action="store_true",
                    help="jaka_replay puts what it recorded in the place of a golden log that differs")


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


@pytest.fixture  # type: ignore[misc]
def jaka_replay(request: Any) -> "Callable[..., Replay]":
    """Return a function that replays a log: ``jaka_replay(golden, tolerances=None, time_scale=None, driver=None)``.

    A relative path is looked for beside the test's file. ``tolerances`` is a YAML file or a ``Tolerances``;
    ``driver`` are the interpreter's arguments that start another driver than this package's.
    """
    from jaka_bag.compare.tolerances import load_tolerances

    from .programs import DRIVER
    from .replay import replay, takes_time_scale

    count = 0

    def run(golden: Union[str, Path], tolerances: "Union[str, Path, Tolerances, None]" = None,
            time_scale: Optional[float] = None, driver: Optional[Sequence[str]] = None) -> "Replay":
        nonlocal count
        count += 1
        beside = Path(str(request.path)).parent
        path = beside / golden
        limits = load_tolerances(beside / tolerances) if isinstance(tolerances, (str, Path)) else tolerances
        folder = report_folder(request.config) / file_name(request.node.nodeid + ("" if count == 1 else "_%d" % count))
        wanted = request.config.getoption("--jaka-time-scale", None)
        if time_scale is None:
            time_scale = wanted if wanted and takes_time_scale(path) else 1.0
        result = replay(path, folder, limits, time_scale, driver=tuple(driver or DRIVER))
        if not result.same and time_scale == 1.0 and request.config.getoption("--jaka-update", False):
            shutil.copyfile(str(result.candidate), str(path))
        return result

    return run
