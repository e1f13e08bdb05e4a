"""The tables of docs/simulation.md say what the code says.

``PYTHONPATH=.:test/support python FILE`` writes them anew.
"""
import re
from pathlib import Path

import pytest
from sdk_2_1_14 import table_rows

from jaka_ros_driver.simulation.controller.command_table import COMMANDS
from jaka_ros_driver.simulation.server.faults import KINDS
from jaka_ros_driver.simulation.server.panel import ACTIONS

HERE = Path(__file__).resolve().parent
PAGE = HERE.parents[1] / "docs" / "simulation.md"
DEEPER = ("controller/test_states", "controller/test_sdk_client", "server/test_panel", "server/test_server",
          "controller/test_link_loss", "test_identity")
BLOCK = "<!-- %s -->\n(.*?)<!-- end -->"


def table(heads, rows):
    lines = ["| %s |" % " | ".join(row) for row in [heads, ["---"] * len(heads), *rows]]
    return "\n".join(line.replace("|  |", "| |") for line in lines) + "\n"


def where_tested(command):
    """``test_commands`` tests each; the others go deeper into some."""
    deeper = [file.split("/")[-1] for file in DEEPER
              if '"%s"' % command in (HERE / (file + ".py")).read_text(encoding="utf-8")]
    return ", ".join(["test_commands", *deeper])


TABLES = {
    "actions": lambda: table(["action", "parameters", ""], [
        ["`%s`" % name, action.parameters, action.meaning] for name, action in ACTIONS.items()]),
    "faults": lambda: table(["kind", "parameters", "a struck message is"], [
        ["`%s`" % name, ", ".join("%s (%g)" % entry for entry in kind.defaults.items()), kind.meaning]
        for name, kind in KINDS.items()]),
    "commands": lambda: table(["command", "section", "tests"], [
        ["`%s`" % name, spec.section, where_tested(name)]
        for name, spec in COMMANDS.items()]),
    "sdk": lambda: table(["command", "1.5.14", "1.7", "what is read", "evidence"], list(table_rows())),
}


@pytest.mark.parametrize("name", TABLES)
def test_table_is_what_the_code_says(name):
    written = re.search(BLOCK % name, PAGE.read_text(encoding="utf-8"), re.DOTALL)
    assert written and written.group(1) == TABLES[name](), "run PYTHONPATH=.:test/support python %s" % __file__


def write():
    text = PAGE.read_text(encoding="utf-8")
    for name, make in TABLES.items():
        block = "<!-- %s -->\n%s<!-- end -->" % (name, make())
        text = re.sub(BLOCK % name, lambda _, block=block: block, text, flags=re.DOTALL)
    PAGE.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    write()
