"""The process that is one stage: it replays a golden log as a job file says, and ends with whoever started it.

A worker of a cluster can be killed at any moment. Its stage notices that its stdin ends, and takes master, simulated
controllers, recorder and drivers down with it.
"""
import json
import os
import signal
import sys
import threading
from pathlib import Path
from typing import Any, Dict, List, Optional

from jaka_bag.compare.report.text import headline
from jaka_bag.compare.tolerances import load_tolerances
from jaka_bag.errors import JakaBagError
from jaka_bag.interrupts import raise_at_first_signal
from jaka_regression.command_lines import DRIVER, driver_in
from jaka_regression.replay import replay

RESULT = "result.json"
STAGE = ("-m", __name__)
"""Arguments of this interpreter that start a replay."""


def _take_signals() -> None:
    """Handle SIGINT and SIGTERM, and have the processes of the stage handle them.

    Workers block or ignore SIGINT: the Ctrl-C of a terminal is for whoever waits for them. Processes inherit that, and
    each would run on until something stronger ends it.
    """
    raise_at_first_signal()
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT, signal.SIGTERM})


def _end_with_the_parent() -> None:
    sys.stdin.buffer.read()
    os.kill(os.getpid(), signal.SIGINT)


def _replay(job: Dict[str, Any]) -> Dict[str, Any]:
    folder = Path(job["folder"])
    limits = load_tolerances(job["tolerances"]) if job["tolerances"] else None
    driver = driver_in(job["driver"]) if job["driver"] else DRIVER
    found = replay(job["golden"], folder, limits, job["time_scale"], driver=driver)
    checks = [check.name for check in found.comparison.worst_first]
    return {"same": found.same, "headline": headline(found.comparison), "summary": found.summary, "differences": checks}


def main(argv: Optional[List[str]] = None) -> int:
    """Replay; what came of it is in ``RESULT`` beside the job file, the only argument."""
    job_file = Path((sys.argv[1:] if argv is None else argv)[0])
    job = json.loads(job_file.read_text(encoding="utf-8"))
    _take_signals()
    threading.Thread(target=_end_with_the_parent, name="parent", daemon=True).start()
    try:
        result = _replay(job)
    except JakaBagError as error:
        result = {"error": str(error)}
    except KeyboardInterrupt:
        return 1
    part = job_file.with_name(RESULT + ".part")
    part.write_text(json.dumps(result), encoding="utf-8")
    part.replace(job_file.with_name(RESULT))
    return 0


if __name__ == "__main__":
    sys.exit(main())
