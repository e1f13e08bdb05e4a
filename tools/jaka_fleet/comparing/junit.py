"""Many runs against one golden log as JUnit XML: a test case for each run; a drift is reported and fails nothing."""
from jaka_bag.compare.report.junit import Case, junit
from jaka_bag.compare.report.text import check_line

from .history import RunHistory
from .outcome import DIFFERENT, NOT_COMPARED, UNKNOWN, RunOutcome, as_check
from .summary import drift_title, drift_words

_OUTCOMES = {DIFFERENT: ("failure", DIFFERENT), NOT_COMPARED: ("error", NOT_COMPARED), UNKNOWN: ("skipped", "")}


def _case(run: RunOutcome) -> Case:
    case = Case("." + (run.cell or "all"), run.path)
    if run.verdict not in _OUTCOMES:
        return case
    outcome, kind = _OUTCOMES[run.verdict]
    lines = [check_line(as_check(check)) for check in run.checks if check.outcome == DIFFERENT]
    return case._replace(outcome=outcome, message=run.reason, kind=kind,
                         text="\n".join(lines) if run.verdict == DIFFERENT else "")


def as_junit(history: RunHistory) -> str:
    """Return the runs as JUnit XML."""
    lines = [history.headline] + ["%s %s" % (drift_title(series), drift_words(series, history.runs_of(series.cell)))
                                  for series in history.drifts]
    return junit("jaka_bag.runs", [_case(run) for run in history.runs], "\n".join(lines))
