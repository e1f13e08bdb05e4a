"""The audit: each defect planted alone into a golden log, and what the comparison says to it."""
import tempfile
from pathlib import Path
from typing import Callable, Dict, List, NamedTuple, Optional, Sequence, Tuple

from ...paths import PathLike
from ..comparison import CannotCompare, compare_runs
from ..matching.alignment import arms_of
from ..matching.cut_motions import cut_motions
from ..runs.loading import load_run
from ..tolerances import Tolerances
from . import defects, streams
from .editing import read_log, write_log

DEFECTS: Dict[str, defects.PlantedDefect] = {**defects.DEFECTS, **streams.DEFECTS}
REASONS: Dict[str, str] = {
    "tool: 5 mm off where a stop left the arm": "timing.cut_ms allows for a stop that comes sooner or later",
    "tool: z off by 2 mm in one motion": "along the path an offset is a time: timing.jitter_ms and stale_ms allow it",
    "time: all 2 % slower": "timing.pace_floor_ms: the motions are short, or begin where a stop left the arm",
    "states: 60 ms late": "states are too brief, or too few motions begin: states.brief_s",
}
"""The reason why a defect can be missed, for those with which that happens."""


class AuditedDefect(NamedTuple):
    """The fate of one defect.

    Attributes:
        defect: Its name.
        found_by: Kinds of the checks that differ; empty where it was missed or not planted.
        is_planted: This log has what the defect needs.
    """

    defect: str
    found_by: Tuple[str, ...]
    is_planted: bool

    @property
    def is_missed(self) -> bool:
        """True where the comparison says that the log with the defect is the same."""
        return self.is_planted and not self.found_by


def audit(golden: PathLike, tolerances: Optional[Tolerances] = None,
          progress: Callable[[AuditedDefect], object] = lambda finding: None) -> List[AuditedDefect]:
    """Compare a golden log with each defect planted into it; return what became of each.

    Args:
        golden: The golden log.
        tolerances: Limits for deviations; None for the defaults.
        progress: Called with each finding as soon as it is there.

    Raises:
        CannotCompare: The log written again without a defect is not the same: nothing could be said.
        BagError: The log cannot be read.
    """
    limits = tolerances or Tolerances()
    run = load_run(golden, limits)
    name, arm = next(iter(arms_of(run, run).items()), ("", None))
    cuts = cut_motions(run, name, arm) if arm is not None else []
    base = defects.Golden(read_log(golden), () if arm is None else arm.golden.facts.motions,
                          tuple((cut.at, cut.until) for cut in cuts))
    findings: List[AuditedDefect] = []
    with tempfile.TemporaryDirectory(prefix="jaka_bag.") as folder:
        place = Path(folder) / "defect.mcap"
        write_log(base.log, place)
        again = compare_runs(run, load_run(place, limits), limits)
        if not again.same:
            raise CannotCompare("%s is not the same as itself: %s" % (golden, again.differences[0].name))
        for name, plant in DEFECTS.items():
            log = plant(base)
            found: Tuple[str, ...] = ()
            if log is not None and log.items == base.log.items:
                log = None  # this log shows no difference, such as a sign of 0
            if log is not None:
                write_log(log, place)
                comparison = compare_runs(run, load_run(place, limits), limits)
                found = tuple(dict.fromkeys(check.aspect.value for check in comparison.differences))
            findings.append(AuditedDefect(name, found, log is not None))
            progress(findings[-1])
    return findings


def fate(finding: AuditedDefect) -> str:
    """Return what became of a defect, in words."""
    if finding.found_by:
        return "found by " + ", ".join(finding.found_by)
    if finding.is_planted:
        return "MISSED: " + REASONS.get(finding.defect, "within the tolerances")
    return "- (nothing in this log to plant it into)"


def finding_line(finding: AuditedDefect) -> str:
    """Return one defect as a line of the table."""
    return "%-46s %s" % (finding.defect, fate(finding))


def summary(findings: Sequence[AuditedDefect]) -> str:
    """Return the numbers of defects planted and missed, in one line."""
    planted = [finding for finding in findings if finding.is_planted]
    missed = [finding.defect for finding in planted if finding.is_missed]
    return "%d of %d defects would be missed%s; %d could not be planted" % (
        len(missed), len(planted), ": " + ", ".join(missed) if missed else "", len(findings) - len(planted))
