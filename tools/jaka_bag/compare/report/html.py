"""The result of a comparison as one HTML page that needs no network and no scripts."""
import os
from html import escape
from typing import Iterable, List, Sequence, Tuple

from ..runs.run import Run
from ..tolerances import Tolerances, as_yaml
from ..verdict import Check, Comparison, Outcome
from .pictures import Figure, Pictures
from .text import beginning_words, headline

_STYLE = """
:root{--page:#f6f7f9;--card:#fff;--text:#1b2330;--faint:#5b6675;--rule:#d7dce3;--golden:#e0a000;--candidate:#1d4fd7;
--difference:#8b2fc9;--band:#2e9e6b26;--bad:#b3261e;--bad-soft:#fdecea;--good:#17693f;--good-soft:#e7f5ed;
--s0:#e4e8ee;--s1:#bcd9f5;--s2:#d3c7f0;--s3:#b9e3c8;--s4:#f0c3e6;--s5:#f3dfa6}
@media (prefers-color-scheme:dark){:root{--page:#12161c;--card:#1b212a;--text:#e8ecf2;--faint:#a3afbf;--rule:#35404e;
--golden:#f0b62e;--candidate:#7aa5ff;--difference:#cf9bf5;--band:#46c48a2e;--bad:#ff9d94;--bad-soft:#3b1e1d;
--good:#7ddba8;--good-soft:#17301f;--s0:#3a4350;--s1:#26507a;--s2:#4d3f86;--s3:#23613c;--s4:#6b2c5f;--s5:#6a551a}}
*{box-sizing:border-box}
body{margin:0;background:var(--page);color:var(--text);
font:15px/1.5 system-ui,"Segoe UI",Roboto,"DejaVu Sans",sans-serif}
main{max-width:1060px;margin:0 auto;padding:20px 16px 60px}
h1{font-size:1.45rem;margin:0 0 4px}h2{font-size:1.15rem;margin:34px 0 10px}h3{font-size:1rem;margin:0 0 4px}
a{color:inherit}
.skip{position:absolute;left:-999px}.skip:focus{left:8px;top:8px;background:var(--card);padding:6px 10px}
.verdict{border-left:8px solid;border-radius:8px;padding:16px 20px;margin-bottom:14px}
.verdict.same{background:var(--good-soft);border-color:var(--good)}
.verdict.different{background:var(--bad-soft);border-color:var(--bad)}
.verdict.same h1{color:var(--good)}.verdict.different h1{color:var(--bad)}
.verdict p{margin:2px 0}
nav ul{display:flex;flex-wrap:wrap;gap:4px 18px;list-style:none;margin:0 0 6px;padding:0}
dl{display:grid;grid-template-columns:max-content 1fr;gap:2px 16px;margin:0}
dt{color:var(--faint)}dd{margin:0;overflow-wrap:anywhere}
.card{background:var(--card);border:1px solid var(--rule);border-radius:8px;padding:14px 16px;margin:0 0 14px}
.card.bad{border-left:5px solid var(--bad)}
.amount{font-variant-numeric:tabular-nums;color:var(--bad);font-weight:600;white-space:nowrap}
.values{margin:6px 0 8px;font-size:.93rem}
figure{margin:8px 0 0}figcaption{font-size:.88rem;color:var(--faint)}
svg{display:block;width:100%;height:auto}
.planes{display:grid;grid-template-columns:repeat(auto-fit,minmax(260px,1fr));gap:10px}
.legend{display:flex;flex-wrap:wrap;gap:4px 20px;font-size:.88rem;color:var(--faint);margin:0 0 10px}
.legend span::before{content:"";display:inline-block;width:26px;height:0;margin-right:7px;vertical-align:middle;
border-top:3px solid var(--k)}
.legend .band::before{height:11px;border:0;background:var(--band);outline:1px solid var(--rule)}
.legend .refused::before{height:11px;border:0;background:var(--bad)}
.legend .golden::before{border-top-width:5px}.legend .mark::before{border-top:2px dashed var(--bad)}
path{fill:none}
.golden{stroke:var(--golden);stroke-width:4;stroke-linejoin:round}
.candidate{stroke:var(--candidate);stroke-width:1.4;stroke-linejoin:round}
.difference{stroke:var(--difference);stroke-width:1.3}.warp{stroke:var(--faint);stroke-width:1.4}
.band{fill:var(--band);stroke:none}.grid{stroke:var(--rule);stroke-width:.7}
.mark{stroke:var(--bad);stroke-width:1.6;stroke-dasharray:5 4}
.mark-point{fill:none;stroke:var(--bad);stroke-width:2}
.tick,.unit,.row{font-size:11.5px;fill:var(--faint)}.row{fill:var(--text)}
.state rect{stroke:var(--card);stroke-width:1}.state text{font-size:11px;fill:var(--text)}
.state0 rect{fill:var(--s0)}.state1 rect{fill:var(--s1)}.state2 rect{fill:var(--s2)}
.state3 rect{fill:var(--s3)}.state4 rect{fill:var(--s4)}.state5 rect{fill:var(--s5)}
.call rect{fill:var(--candidate);opacity:.75}.call.failed rect{fill:var(--bad);opacity:1}
.scroll{overflow-x:auto}
table{border-collapse:collapse;width:100%;font-size:.9rem}
th,td{text-align:left;padding:5px 10px 5px 0;border-bottom:1px solid var(--rule);vertical-align:top}
td.number{text-align:right;font-variant-numeric:tabular-nums;white-space:nowrap}
.outcome{white-space:nowrap;font-weight:600}.outcome.different{color:var(--bad)}.outcome.same{color:var(--good)}
.outcome.not-compared{color:var(--faint);font-weight:400}
pre{overflow:auto;font-size:.82rem;background:var(--page);padding:10px;border-radius:6px}
summary{cursor:pointer}
@media print{body{background:#fff}.card{break-inside:avoid}details{display:block}}
"""
_SIGNS = {Outcome.SAME: "&#10003; same", Outcome.DIFFERENT: "&#10007; different",
          Outcome.NOT_COMPARED: "&#8211; not compared"}
_MOST_PICTURES = 30
"""Differences with a picture: with thousands a page would be too large for a browser."""
_EARLY_S = 2.0
"""Time, s, by which one log's activity ends before the other's to be told: late motions alone are less."""
_LEGEND = """<p class="legend"><span class="golden" style="--k:var(--golden)">golden log</span>
<span class="candidate" style="--k:var(--candidate)">candidate</span>
<span class="difference" style="--k:var(--difference)">how far off, less what jitter and stops allow</span>
<span class="band">allowed</span><span class="mark">worst moment</span>
<span class="refused">a call that failed</span></p>"""


_Section = Tuple[str, str, str]
"""Anchor, heading and content of a part of a page, HTML."""


def page(title: str, body: str, more_style: str = "") -> str:
    """Return a page without network and scripts, to be written as UTF-8; ``body`` is HTML, ``title`` is text."""
    return ('<!DOCTYPE html><html lang="en"><head><meta charset="utf-8">'
            '<meta name="viewport" content="width=device-width,initial-scale=1">'
            "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; style-src 'unsafe-inline'\">"
            '<title>%s</title><style>%s</style></head><body>%s</body></html>\n'
            % (escape(title), _STYLE + more_style, body))


def contents_of(sections: Sequence[_Section]) -> str:
    """Return links to the sections, HTML."""
    links = "".join('<li><a href="#%s">%s</a></li>' % (anchor, heading) for anchor, heading, _ in sections)
    return '<nav aria-label="Sections"><ul>%s</ul></nav>' % links


def body_of(sections: Sequence[_Section]) -> str:
    """Return the sections below one another, HTML."""
    return "".join('<section id="%s"><h2>%s</h2>%s</section>' % section for section in sections)


def figures_of(figures: Iterable[Figure]) -> str:
    """Return pictures, each below its caption, as HTML."""
    return "".join("<figure><figcaption>%s</figcaption>%s</figure>" % (escape(figure.caption), figure.picture)
                   for figure in figures)


def definitions(rows: Iterable[Tuple[str, str]]) -> str:
    """Return pairs of a word and its meaning, text, as HTML."""
    return "<dl>%s</dl>" % "".join("<dt>%s</dt><dd>%s</dd>" % (escape(a), escape(b)) for a, b in rows)


def _difference(check: Check, more: Sequence[Check], figures: List[Figure]) -> str:
    rows = [("golden", check.golden), ("candidate", check.candidate)] if check.golden or check.candidate else []
    rows += [("also", one.name) for one in more]
    values = definitions(rows) if rows else ""
    return ('<article class="card bad"><h3>%s</h3><p>%s <span class="amount">%s</span></p>'
            '<div class="values">%s</div>%s</article>'
            % (escape(check.name), escape(check.detail), escape(check.amount), values, figures_of(figures)))


def _table(checks: Iterable[Check]) -> str:
    rows = "".join(
        '<tr><td class="outcome %s">%s</td><th scope="row">%s</th><td>%s</td><td class="number">%s</td></tr>'
        % (check.outcome.value.replace(" ", "-"), _SIGNS[check.outcome], escape(check.name), escape(check.detail),
           escape(check.amount)) for check in checks)
    return ('<div class="scroll"><table><thead><tr><th scope="col">Outcome</th><th scope="col">Check</th>'
            '<th scope="col">Seen</th><th scope="col">Measured, of what is allowed</th></tr></thead>'
            '<tbody>%s</tbody></table></div>' % rows)


def _last_activity(run: Run) -> float:
    """Return when the last call or motion of a log ends, s since its begin."""
    ends = [call.end for call in run.calls] + [end for track in run.joints.values() for _, end in track.facts.motions]
    return max(ends, default=0.0)


def _early_end(comparison: Comparison) -> List[Tuple[str, str]]:
    """Return a fact about a log in which nothing is called or moves any more long before the other; mostly none."""
    ends = [_last_activity(comparison.golden), _last_activity(comparison.candidate) - comparison.alignment.lag]
    if abs(ends[0] - ends[1]) < _EARLY_S:
        return []
    words = ("candidate", "golden log") if ends[1] < ends[0] else ("golden log", "candidate")
    return [("ends early", "after %.1f s nothing is called or moves in the %s; in the %s until %.1f s"
             % (min(ends), words[0], words[1], max(ends)))]


def as_html(comparison: Comparison, tolerances: Tolerances) -> str:
    """Return the page about a comparison, to be written as UTF-8."""
    pictures = Pictures(comparison, tolerances)
    golden, candidate, alignment = comparison.golden, comparison.candidate, comparison.alignment
    title = "%s against %s" % (os.path.basename(candidate.path), os.path.basename(golden.path))
    verdict, sign, words = ("same", "&#10003;", "The candidate does what the golden log shows") if comparison.same \
        else ("different", "&#10007;", "The candidate differs from the golden log")
    facts = [("golden log", "%s, %.1f s" % (golden.path, golden.duration)),
             ("candidate", "%s, %.1f s" % (candidate.path, candidate.duration)),
             ("alignment", "the candidate is %.3f s %s, found by %s; not judged"
              % (abs(alignment.lag), "behind" if alignment.lag >= 0.0 else "ahead", alignment.method))]
    if comparison.time_scale != 1.0:
        facts.append(("speed", "the candidate ran %g times faster" % comparison.time_scale))
    facts += _early_end(comparison)
    first = comparison.beginning
    if first is not None:
        facts.append(("it begins with", beginning_words(first, len(comparison.differences) - 1)))
    facts += [("of no effect", "tolerances: %s" % text) for text in comparison.unmatched]
    worst = sorted(comparison.folded, key=lambda entry: first not in (entry[0], *entry[1]))
    cards = "".join(_difference(check, more, pictures.moment(check) if number < _MOST_PICTURES else [])
                    for number, (check, more) in enumerate(worst))
    order = "<p>What it begins with, then the worst first.</p>"
    sections = [("differences", "Differences", order + _LEGEND + cards)] if worst else []
    sections += [(name, heading, '<div class="card">%s</div>' % content) for name, heading, content in (
        ("timeline", "States and calls", figures_of(pictures.time_lines())),
        ("path", "Tool centre point", figures_of(pictures.paths())),
        ("joints", "Joints", figures_of(pictures.joints())),
        ("timing", "Timing of the motions", figures_of(pictures.timing())),
        ("checks", "All checks", _table(comparison.checks)),
        ("tolerances", "Tolerances", "<details><summary>The tolerances as a YAML file</summary><pre>%s</pre></details>"
         % escape(as_yaml(tolerances)))) if content]
    return page("%s: %s" % (verdict, title), (
        '<a class="skip" href="#checks">To all checks</a><main>'
        '<header class="verdict %s"><h1>%s %s</h1><p>%s</p></header>%s'
        '<div class="card">%s</div>%s%s</main>'
        % (verdict, sign, words, escape(headline(comparison)), contents_of(sections), definitions(facts),
           _LEGEND if not worst else "", body_of(sections))))
