"""The page about an audit: a table of the defects, and of the checks that found each."""
import os
from html import escape
from typing import Sequence

from ..audit.auditing import AuditedDefect, fate, summary
from ..tolerances import Tolerances, as_yaml
from .html import body_of, contents_of, page


def audit_page(golden: str, findings: Sequence[AuditedDefect], tolerances: Tolerances) -> str:
    """Return the page about the audit of a golden log, to be written as UTF-8; missed defects come first."""
    missed = sum(finding.is_missed for finding in findings)
    verdict, sign, words = ("different", "&#10007;", "Some defects would be missed") if missed else (
        "same", "&#10003;", "Each defect that was planted is found")
    sections = [
        ("defects", "Defects", _table(sorted(findings, key=lambda one: not one.is_missed))),
        ("tolerances", "Tolerances", "<details><summary>The tolerances as a YAML file</summary><pre>%s</pre></details>"
         % escape(as_yaml(tolerances)))]
    return page("%d missed: audit of %s" % (missed, os.path.basename(golden)), (
        '<main><header class="verdict %s"><h1>%s %s</h1><p>%s: %s</p></header>%s%s</main>'
        % (verdict, sign, words, escape(golden), escape(summary(findings)), contents_of(sections),
           body_of(sections))))


def _table(findings: Sequence[AuditedDefect]) -> str:
    rows = "".join('<tr><th scope="row">%s</th><td class="outcome %s">%s</td></tr>' % (
        escape(finding.defect),
        "different" if finding.is_missed else "same" if finding.is_planted else "not-compared",
        escape(fate(finding))) for finding in findings)
    return ('<div class="scroll"><table><thead><tr><th scope="col">Defect</th><th scope="col">What became of it</th>'
            '</tr></thead><tbody>%s</tbody></table></div>' % rows)
