"""Names in tolerance files that match nothing in the golden log: told, and with --strict a failure."""
import json
from pathlib import Path

import pytest
from import_graph import ROOT
from synthetic_session import Conditions, simulate, write_log

from jaka_bag.cli.main import main
from jaka_bag.compare import unmatched
from jaka_bag.compare.comparison import compare_logs
from jaka_bag.compare.learning import learn
from jaka_bag.compare.runs.loading import load_run
from jaka_bag.compare.tolerances import Tolerances, parse_tolerances

TOPIC, TOOL = "/jaka_driver/joint_position", "/jaka_driver/tool_position"
WRONG = [
    ("joints: {per_joint: {jiont_1: 0.5}}", "did you mean 'joint_1'"),
    ("envelopes: {%s: {joint1: [[0, 0.5]]}}" % TOPIC, "did you mean 'joint_1'"),
    ("envelopes: {%ss: {joint_1: [[0, 0.5]]}}" % TOPIC, "did you mean '%s'" % TOPIC),
    ("envelopes: {%s: {positoin: [[0, 0.5]]}}" % TOOL, "did you mean 'position'"),
    ("fields: {%ss: {position: {absolute: 0.5}}}" % TOPIC, "no topic '%ss'" % TOPIC),
]
RIGHT = [
    "", "joints: {per_joint: {joint_1: 0.5}}", "envelopes: {%s: {joint_1: [[0, 0.5]]}}" % TOPIC,
    "envelopes: {%s: {position: [[0, 5]], orientation: [[0, 1]]}}" % TOOL,
    "fields: {%s: {position: {absolute: 0.5}}}" % TOPIC, "fields: {%s: {twist.linear.y: {absolute: 1}}}" % TOOL,
    "fields: {%s: {position: {absolute: 0.5}}}\nenvelopes: {%s: {position: [[0, 0.5]]}}" % (TOPIC, TOPIC),
]


@pytest.fixture(scope="module")
def candidate(program, tmp_path_factory):
    return write_log(tmp_path_factory.mktemp("candidate") / "same.mcap", simulate(program, Conditions(seed=31)))


@pytest.fixture
def compare(golden, candidate, tmp_path, capsys):
    """Return a function that compares by tolerances given as text; exit code, output and errors."""
    def compared(text, *words):
        (tmp_path / "file.yaml").write_text(text)
        code = main(["compare", str(golden), str(candidate), "--tolerances", str(tmp_path / "file.yaml"), *words])
        return (code, *capsys.readouterr())
    return compared


@pytest.mark.parametrize("text, words", WRONG)
def test_a_misspelt_name_is_told_with_what_was_meant(compare, text, words):
    code, told, _ = compare(text)
    assert code == 0 and words in told
    code, told, errors = compare(text, "-q")
    assert code == 0 and words in errors and words not in told
    code, told, errors = compare(text, "--json")
    assert code == 0 and words in errors and words in " ".join(json.loads(told)["unmatched_tolerances"])


def test_it_is_a_failure_with_strict(compare):
    every = "ignore_fields: ['.*']\n"
    code, _, errors = compare(every, "--strict")
    assert code == 0, errors
    for text, words in WRONG:
        code, _, errors = compare(every + text, "--strict")
        assert code == 1 and words in errors


@pytest.mark.parametrize("text", RIGHT)
def test_names_that_are_there_are_no_news(compare, text):
    code, told, errors = compare(text, "-q")
    assert code == 0 and not errors and "no " not in told


@pytest.mark.parametrize("path", sorted((ROOT / "test" / "data" / "golden").glob("*.mcap")), ids=lambda one: one.stem)
def test_what_was_learned_from_a_log_is_in_it(path):
    learned = learn(path, [path] * 5, Tolerances()).tolerances
    assert unmatched.unmatched_names(load_run(path, learned), learned) == ()


def test_the_page_tells_it(compare, tmp_path):
    compare(WRONG[0][0], "--html", str(tmp_path / "page.html"))
    assert "jiont_1" in (tmp_path / "page.html").read_text(encoding="utf-8").partition("All checks</h2>")[0]


def test_a_comparison_without_tolerances_names_nothing(golden, candidate):
    assert compare_logs(golden, candidate).unmatched == ()
    assert compare_logs(golden, candidate, parse_tolerances(WRONG[0][0])).unmatched != ()


def test_many_runs_and_sweeps_tell_it(golden, candidate, tmp_path, capsys):
    wrong = Path(str(tmp_path / "wrong.yaml"))
    wrong.write_text(WRONG[0][0])
    words = ["compare", str(golden), "--against", str(candidate.parent), "--results", str(tmp_path / "results"), "-q"]
    for more in (["--jobs", "1", "--tolerances", str(wrong)], ["--sweep", str(wrong)]):
        assert main([*words, *more]) == 0
        assert "did you mean 'joint_1'" in capsys.readouterr().err
    assert main([*words, "--jobs", "1"]) == 0
    assert "did you mean" not in capsys.readouterr().err
