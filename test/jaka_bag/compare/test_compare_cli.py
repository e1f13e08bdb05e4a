"""The command jaka_bag compare: exit codes, outputs, options."""
import json

import pytest
from seeded_defects import DEFECTS, defective
from synthetic_session import Conditions, simulate, write_log

from jaka_bag.cli.main import main
from jaka_bag.compare.tolerances import Tolerances, parse_tolerances


@pytest.fixture(scope="module")
def candidates(program, tmp_path_factory):
    folder = tmp_path_factory.mktemp("candidates")
    return (write_log(folder / "same.bag", simulate(program, Conditions(seed=31, start_s=1.4))),
            write_log(folder / "different.mcap", defective(program, DEFECTS["1 mm offset"])))


def test_the_same_is_0_and_different_is_1(golden, candidates, capsys):
    assert main(["compare", str(golden), str(candidates[0])]) == 0
    assert capsys.readouterr().out.splitlines()[-2].startswith("same: ")
    assert main(["compare", str(golden), str(candidates[1]), "-q"]) == 1
    assert capsys.readouterr().out.startswith("DIFFERENT: 1 of ")


@pytest.mark.parametrize("arguments, words", [
    (["{golden}", "{golden}.nothing"], "cannot read"), (["{golden}"], "GOLDEN and CANDIDATE are needed"),
    (["{golden}", "{same}", "--tolerances", "{golden}.yaml"], "cannot read"),
    (["{golden}", "{same}", "--html", "{same}"], "is one of the logs"),
    (["{golden}", "{same}", "--time-scale", "0"], "above 0"),
])
def test_what_cannot_be_compared_is_2(golden, candidates, capsys, arguments, words):
    filled = [text.format(golden=golden, same=candidates[0]) for text in arguments]
    assert main(["compare", *filled]) == 2
    assert words in capsys.readouterr().err


def test_reports_are_written_and_never_overwritten_unasked(golden, candidates, tmp_path, capsys):
    names = {kind: tmp_path / ("a." + kind) for kind in ("html", "report", "junit")}
    options = [word for kind, path in names.items() for word in ("--" + kind, str(path))]
    assert main(["compare", str(golden), str(candidates[1]), *options]) == 1
    assert json.loads(names["report"].read_text())["same"] is False
    assert names["html"].read_text(encoding="utf-8").startswith("<!DOCTYPE html>")
    assert "<failure" in names["junit"].read_text(encoding="utf-8")
    before = names["html"].read_bytes()
    assert main(["compare", str(golden), str(candidates[0]), *options]) == 2
    assert "exists" in capsys.readouterr().err
    assert names["html"].read_bytes() == before
    assert main(["compare", str(golden), str(candidates[0]), *options, "--force"]) == 0
    assert json.loads(names["report"].read_text())["same"] is True
    (tmp_path / "empty.mcap").write_bytes(b"")
    assert main(["compare", str(golden), str(tmp_path / "empty.mcap"), *options, "--force"]) == 2
    assert "empty.mcap" in json.loads(names["report"].read_text())["error"], "it is that of the run before"
    assert "not compared" in names["html"].read_text() and "<error" in names["junit"].read_text()


def test_tolerances_are_printed_and_used(golden, candidates, tmp_path, capsys):
    assert main(["compare", "--print-tolerances"]) == 0
    text = capsys.readouterr().out
    assert parse_tolerances(text) == Tolerances()
    wide = tmp_path / "wide.yaml"
    wide.write_text(text.replace("position_mm: 0.5", "position_mm: 5"))
    assert main(["compare", str(golden), str(candidates[1]), "--tolerances", str(wide)]) == 0


def test_a_log_is_the_same_as_itself(golden):
    assert main(["compare", str(golden), str(golden), "-q"]) == 0
