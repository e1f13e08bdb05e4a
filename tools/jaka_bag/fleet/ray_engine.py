"""Tasks on the workers of a Ray cluster, or of this computer."""
import importlib
from typing import Any, Dict, Iterable, Optional

from ..errors import BagError, MissingDependency
from .tasks import BoundFunction, Engine, LogTask, OnResult, failure

_IN_FLIGHT = 1024
_RETRIES = 3


class Ray(Engine):
    """On Ray workers, which see the same files under the same names and have this package.

    Args:
        address: Of a cluster, as ``ray.init`` takes it; None for one of this computer.
        workers: Processes of a cluster of this computer.
    """

    def __init__(self, address: Optional[str] = None, workers: int = 2) -> None:
        self._address = address
        self._workers = workers

    def run(self, function: BoundFunction, tasks: Iterable[LogTask], on_result: OnResult) -> None:
        try:
            ray = importlib.import_module("ray")
        except ImportError:
            raise MissingDependency("--ray needs the Python package ray") from None
        options = {"num_cpus": self._workers, "include_dashboard": False} if self._address is None else {}
        try:
            ray.init(address=self._address, log_to_driver=False, logging_level="ERROR", **options)
        except (ConnectionError, ValueError) as error:
            raise BagError("cannot reach the Ray cluster %s: %s" % (self._address, error)) from error
        try:
            self._work(ray, function, iter(tasks), on_result)
        finally:
            ray.shutdown()

    def _work(self, ray: Any, function: BoundFunction, tasks: Iterable[LogTask], on_result: OnResult) -> None:
        remote = ray.remote(num_cpus=1, max_retries=_RETRIES)(_call)
        source = iter(tasks)
        running: Dict[Any, LogTask] = {}
        while True:
            while len(running) < _IN_FLIGHT:
                task = next(source, None)
                if task is None:
                    break
                running[remote.remote(function, task)] = task
            if not running:
                return
            (reference,), _ = ray.wait(list(running), num_returns=1)
            task = running.pop(reference)
            try:
                result = ray.get(reference)
            except ray.exceptions.RayError as error:
                result = failure(task, "%s: %s" % (task.path, " ".join(str(error).split())))
            on_result(result)


def _call(function: BoundFunction, task: LogTask) -> Any:
    return function(task)
