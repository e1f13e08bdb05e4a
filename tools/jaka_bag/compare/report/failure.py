"""The reports of a run that could not be compared: the same three files, with the reason in place of a verdict."""
import json
from html import escape
from pathlib import Path
from typing import Sequence, Tuple

from ...output_file import write_text
from .html import definitions, page
from .junit import SUITE, Case, junit

REPORT_NAMES = ("report.html", "report.xml", "report.json")
"""Names of a run's reports in its folder."""


def remove_reports(folder: Path) -> None:
    """Remove the reports of an earlier run: none of them may be taken for this run's."""
    for name in REPORT_NAMES:
        try:
            (folder / name).unlink()
        except FileNotFoundError:
            pass


def failure_texts(golden: str, reason: str, logs: Sequence[str] = ()) -> Tuple[str, str, str]:
    """Return page, JUnit XML and JSON about a run that could not be compared.

    Args:
        golden: Path of the golden log.
        reason: The reason, for the user.
        logs: Names of the files with what its processes printed.
    """
    facts = [("golden log", golden)] + ([("what the processes printed", ", ".join(logs))] if logs else [])
    body = ('<main><header class="verdict different"><h1>&#10007; not compared</h1><p>%s</p></header>'
            '<div class="card">%s</div></main>' % (escape(reason).replace("\n", "<br>"), definitions(facts)))
    return (page("not compared: %s" % Path(golden).name, body),
            junit(SUITE, [Case("", "the run", "error", reason.split("\n")[0], "not compared", reason)],
                  "NOT COMPARED: " + reason),
            json.dumps({"same": False, "error": reason, "golden": golden}, indent=1) + "\n")


def write_failure(folder: Path, golden: str, reason: str) -> None:
    """Write the reports of a run that ended before it could be compared.

    Args:
        folder: Folder of the reports; the outputs of the run's processes stand in it as ``NAME.log``.
        golden: Path of the golden log.
        reason: The reason, for the user.

    Raises:
        BagError: One cannot be created.
    """
    texts = failure_texts(golden, reason, sorted(path.name for path in folder.glob("*.log")))
    for name, text in zip(REPORT_NAMES, texts):
        write_text(folder / name, text, True)
