"""The page docs/first_contact.md beside the programs: the steps, their order, and the time that a person needs."""
import re

import pytest
from import_graph import ROOT
from virtual_probe import probed

from jaka_ros_driver.probe.facts import ProbeStage
from jaka_ros_driver.probe.move import STEPS
from jaka_ros_driver.probe.pendant_steps import PROGRAM
from jaka_ros_driver.probe.servo_steps import GAPS_MS
from jaka_ros_driver.simulation.dialect.table import Dialect

PAGE = (ROOT / "docs" / "first_contact.md").read_text(encoding="utf-8")
WORDS = " ".join(PAGE.split())
ANSWER_S = 10.0
NUMBERS = {14: "fourteen", 15: "fifteen", 16: "sixteen"}


def lasted(stage, dialect, seconds=30.0):
    bench, _ = probed(dialect, "1.7.2", stage, seconds=seconds)
    return bench.now - bench.begun


def test_the_page_has_the_steps_as_the_probe_says_and_counts_them():
    block = PAGE.split("<!-- steps -->\n")[1].split("<!-- end of steps -->")[0]
    listed = [" ".join(one.split()) for one in re.split(r"^\d+\. ", block, flags=re.MULTILINE)[1:]]
    assert listed == [step.says for step in STEPS]
    assert "before each of %s steps, %s with `--program`," % (NUMBERS[len(STEPS) - 1], NUMBERS[len(STEPS)]) in WORDS
    assert STEPS.index(PROGRAM) == len(STEPS) - 2, "the step that is left out is the last but one"
    assert "gaps" in STEPS[7].says and "The gaps of step 8 are %d, %d, %d and %d ms." % GAPS_MS in WORDS
    assert "stops those of all joints" in STEPS[5].says and "In step 6 all joints" in WORDS


def test_the_page_says_how_long_it_takes():
    plain = Dialect.default("1.7.2")
    asked, set_same, whole = (lasted(stage, plain) for stage in (ProbeStage.ASK, ProbeStage.SET, ProbeStage.MOVE))
    assert "half a minute and a few seconds" in WORDS and 30.0 < asked < 36.0 and set_same < 40.0
    motions = whole - set_same
    assert "motions take a minute and a quarter" in WORDS and motions == pytest.approx(75.0, abs=7.5)
    answers = ANSWER_S * (1 + len(STEPS))  # the arm's name, too
    assert "with ten seconds for each answer the stage takes four minutes, all stages together less than five" in WORDS
    assert round((motions + answers) / 60.0) == 4 < (whole + answers) / 60.0 < 5
    late = lasted(ProbeStage.MOVE, plain.replaced({"start_delay": 10.0}))
    assert "takes twenty times these seconds more" in WORDS and (late - whole) / 10.0 == pytest.approx(20.0, abs=2.0)
