"""The plans that pages may run, and the folder of logs."""
import json
import os
import secrets
import subprocess
import sys
from collections import OrderedDict
from typing import Any, Dict, List, Optional, Tuple, Union

from .motion_list import ListPlan
from .point_plan import Plan, WrongPlan

_KEPT = 20
"""Newest plans that are kept; a page runs one that it has just shown."""
_MOST_LOGS = 500
"""Newest logs of a folder that a page lists."""
_SUFFIXES = (".bag", ".mcap")
_LOG_PLAN = "jaka_panel.plans.log_plan"
LOG_TIMEOUT_S = 120.0
"""Longest wait, s, for the plan of a log, which a process of its own makes; then a page is told."""

AnyPlan = Union[Plan, ListPlan]


class PlanStore:
    """The newest plans by name, each for one arm; no panel that is started later gives such a name again."""

    def __init__(self) -> None:
        self._begin = secrets.token_hex(4)
        self._plans: OrderedDict[str, Tuple[str, AnyPlan]] = OrderedDict()
        self._count = 0

    def put(self, arm: str, plan: AnyPlan) -> str:
        """Keep a plan; return its name."""
        self._count += 1
        name = "%s-%d" % (self._begin, self._count)
        self._plans[name] = (arm, plan)
        while len(self._plans) > _KEPT:
            self._plans.popitem(last=False)
        return name

    def get(self, arm: str, name: Any) -> AnyPlan:
        """Return a plan of this arm; raise WrongPlan if it is not there any more."""
        found = self._plans.get(name) if isinstance(name, str) else None
        if found is None or found[0] != arm:
            raise WrongPlan("no such plan: plan it anew")
        return found[1]


class LogDirectory:
    """The logs in one folder, not below it."""

    def __init__(self, folder: Optional[str]) -> None:
        self.folder = folder

    def entries(self) -> List[Dict[str, Any]]:
        """Name, size and time of change of each log, newest first; raises OSError where the folder cannot be read."""
        if self.folder is None:
            return []
        found = []
        with os.scandir(self.folder) as entries:
            for entry in entries:
                if entry.name.endswith(_SUFFIXES) and not entry.name.startswith(".") and entry.is_file():
                    about = entry.stat()
                    found.append({"file": entry.name, "size": about.st_size, "wall": round(about.st_mtime, 3)})
        return sorted(found, key=lambda log: (-float(str(log["wall"])), str(log["file"])))[:_MOST_LOGS]

    def plan(self, name: Any, factor: float, urdf: str) -> Plan:
        """Plan a log by its name, in a process that is waited for; raise WrongPlan, OSError."""
        if self.folder is None or name not in [entry["file"] for entry in self.entries()]:
            raise WrongPlan("no such log")
        try:
            done = subprocess.run([sys.executable, "-m", _LOG_PLAN, os.path.join(self.folder, name), "%.6g" % factor],
                                  input=urdf, capture_output=True, text=True, timeout=LOG_TIMEOUT_S)
            told = json.loads(done.stdout)
        except subprocess.TimeoutExpired:
            raise WrongPlan("planning takes longer than %g s" % LOG_TIMEOUT_S) from None
        except ValueError:
            raise WrongPlan("planning failed: %s" % (done.stderr.strip().splitlines() or ["no word"])[-1]) from None
        if "error" in told:
            raise WrongPlan(str(told["error"]))
        return Plan(told["time"], told["position"], told["velocity"], told["acceleration"], told["warnings"], True)
