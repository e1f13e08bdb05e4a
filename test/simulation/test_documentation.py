"""The tables of docs/simulation.md, which are made from the code; ``WRITE_ANEW`` writes them anew."""
import json
import re
import textwrap
from pathlib import Path

import pytest
from sdk_2_1_14 import table_rows

from jaka_ros_driver.simulation.controller.command_table import COMMANDS
from jaka_ros_driver.simulation.dialect.dimension import FIRMWARE_NAMES
from jaka_ros_driver.simulation.dialect.table import DIMENSIONS
from jaka_ros_driver.simulation.server.faults import KINDS
from jaka_ros_driver.simulation.server.operator_actions import ACTIONS

HERE = Path(__file__).resolve().parent
PAGE = HERE.parents[1] / "docs" / "simulation.md"
PROTOCOL = PAGE.with_name("controller-protocol.md")
DEEPER = ("controller/test_states", "controller/test_content",
          "controller/test_sdk_client", "server/test_operator_port", "server/test_server",
          "controller/test_link_loss", "test_identity")
WRITE_ANEW = "PYTHONPATH=.:test/support build/venv/bin/python3 test/simulation/test_documentation.py"
LONGEST_CELL = 120
BLOCK = "<!-- %s -->\n(.*?)<!-- end -->"


def table(heads, rows):
    """Return a table; what is too long for a cell stands in a list below it."""
    notes = []
    for row in rows:
        for column, cell in enumerate(row):
            if len(cell) > LONGEST_CELL:
                notes.append(textwrap.fill("- %s, %s: %s" % (row[0], heads[column], cell), 118, subsequent_indent="  ",
                                           break_long_words=False, break_on_hyphens=False))
                row[column] = "see below"
    lines = ["| %s |" % " | ".join(row) for row in [heads, ["---"] * len(heads), *rows]]
    return "\n".join([*(line.replace("|  |", "| |") for line in lines), *([""] if notes else []), *notes]) + "\n"


def where_tested(command):
    """Return the tests of a command: ``test_commands`` tests each; the others go deeper into some."""
    deeper = [file.split("/")[-1] for file in DEEPER
              if '"%s"' % command in (HERE / (file + ".py")).read_text(encoding="utf-8")]
    return ", ".join(["test_commands", *deeper])


def default_of(dimension):
    """Return the default, or those of the firmwares where they differ; nothing for none of many names."""
    shown = [json.dumps(value) if not isinstance(value, (str, tuple)) else value or "none"
             for value in map(dimension.default, FIRMWARE_NAMES)]
    return shown[0] if len(set(shown)) == 1 else ", ".join(
        "%s: %s" % one for one in zip(FIRMWARE_NAMES, shown))


TABLES = {
    "dimensions": lambda: table(["dimension", "what it says", "values", "default", "evidence"], [
        ["`%s`" % name, dimension.meaning, dimension.described(), default_of(dimension), dimension.evidence]
        for name, dimension in DIMENSIONS.items()]),
    "actions": lambda: table(["action", "parameters", "what it does"], [
        ["`%s`" % name, action.parameters, action.meaning] for name, action in ACTIONS.items()]),
    "faults": lambda: table(["kind", "parameters", "a struck message is"], [
        ["`%s`" % name, ", ".join("%s (%g)" % entry for entry in kind.defaults.items()), kind.meaning]
        for name, kind in KINDS.items()]),
    "commands": lambda: table(["command", "section", "tests"], [
        ["`%s`" % name, spec.section, where_tested(name)]
        for name, spec in COMMANDS.items()]),
    "sdk": lambda: table(["command", "1.5.14", "1.7", "what is read", "evidence"], list(map(list, table_rows()))),
}


@pytest.mark.parametrize("name", TABLES)
def test_table_is_what_the_code_says(name):
    written = re.search(BLOCK % name, PAGE.read_text(encoding="utf-8"), re.DOTALL)
    assert written and written.group(1) == TABLES[name](), "run " + WRITE_ANEW


def open_points():
    """Return the numbered points of section 13 of the protocol page: number and text."""
    section = PROTOCOL.read_text(encoding="utf-8").split("## 13. Open uncertainties")[1].split("\n## ")[0]
    return re.findall(r"^(\d+)\. (.*?)(?=^\d+\. |\Z)", section, re.DOTALL | re.MULTILINE)


def test_each_open_point_names_its_dimensions_or_says_why_it_has_none():
    points = open_points()
    assert [int(number) for number, _ in points] == list(range(1, len(points) + 1)) and len(points) >= 30
    named = set()
    for number, text in points:
        text = " ".join(text.split())
        lists = re.findall(r"Dimensions?: (.*?)[.;](?= |$)", text)
        names = [name for one in lists for name in re.findall(r"`(\w+)`", one)]
        assert names or re.search(r"No dimension[^:.]*: \w+ \w+ \w+", text), "point %s says neither" % number
        assert set(names) <= set(DIMENSIONS), "point %s: %s" % (number, set(names) - set(DIMENSIONS))
        named |= set(names)
    assert named == set(DIMENSIONS), "no open point stands behind %s" % sorted(set(DIMENSIONS) - named)


def test_the_evidence_of_a_dimension_is_in_sections_that_exist():
    headings = set(re.findall(r"^#+ (\d+(?:\.\d+)*)", PROTOCOL.read_text(encoding="utf-8"), re.MULTILINE))
    for name, dimension in DIMENSIONS.items():
        sections = re.findall(r"\d+(?:\.\d+)*", dimension.evidence.rpartition(": ")[2])
        assert sections and set(sections) <= headings, "%s: %s" % (name, dimension.evidence)


def write():
    text = PAGE.read_text(encoding="utf-8")
    for name, make in TABLES.items():
        block = "<!-- %s -->\n%s<!-- end -->" % (name, make())
        text = re.sub(BLOCK % name, lambda _, block=block: block, text, flags=re.DOTALL)
    PAGE.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    write()
