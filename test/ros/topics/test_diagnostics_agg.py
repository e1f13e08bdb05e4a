"""The groups for /diagnostics_agg: each diagnostic falls into one, by the rules of the wiki's GenericAnalyzer.

Debian has no diagnostic_aggregator. Its rules (wiki.ros.org/diagnostic_aggregator/Tutorials/Configuring Diagnostic
Aggregators): a status belongs to an analyzer where its name contains an entry of ``contains``, begins with one of
``startswith`` or equals one of ``name``, after "/" in both was replaced by " "; all analyzers that match show it.
"""
import re

import pytest
import yaml
from import_graph import ROOT

from jaka_ros_driver.ros.topics.diagnostic_states import STATES

FILE = ROOT / "launch" / "diagnostics_agg.yaml"
CHECKS = sorted({state.check for state in STATES} - {""})
KNOWN = {"type", "path", "contains", "startswith", "name", "timeout", "num_items", "find_and_remove_prefix",
         "discard_stale"}
DRIVERS = ("jaka_driver", "left/jaka_driver", "cell/right/arm_2")
"""Names as diagnostic_updater writes them in front of each check: the node's, without its first slash."""


def analyzers():
    return yaml.safe_load(FILE.read_text(encoding="utf-8"))["analyzers"]


def clean(text):
    return text.lstrip("/").replace("/", " ")


def groups_of(name, table):
    """Return the paths of all analyzers that show the status of this name."""
    def matches(analyzer):
        def entries(key):
            given = analyzer.get(key, [])
            return [clean(entry) for entry in ([given] if isinstance(given, str) else given)]
        return (any(entry in clean(name) for entry in entries("contains"))
                or any(clean(name).startswith(entry) for entry in entries("startswith"))
                or clean(name) in entries("name"))
    return [analyzer["path"] for analyzer in table.values() if matches(analyzer)]


def misplaced(table):
    """Return each diagnostic that does not fall into exactly one group, with its groups."""
    names = ["%s: %s" % (driver, check) for driver in DRIVERS for check in CHECKS]
    return {name: groups_of(name, table) for name in names if len(groups_of(name, table)) != 1}


def test_the_file_is_what_the_aggregator_takes():
    table = analyzers()
    assert len({analyzer["path"] for analyzer in table.values()}) == len(table)
    for analyzer in table.values():
        assert set(analyzer) <= KNOWN and analyzer["type"] == "diagnostic_aggregator/GenericAnalyzer"
        assert isinstance(analyzer["timeout"], float) and analyzer["timeout"] >= 3.0, "diagnostics come once a second"


def test_each_diagnostic_falls_into_one_group():
    assert len(CHECKS) == 15 and not misplaced(analyzers())


def test_no_entry_is_stale():
    entries = {entry for analyzer in analyzers().values() for entry in analyzer["contains"]}
    assert entries == {": " + check for check in CHECKS}


@pytest.mark.parametrize("path", ["Connection", "Safety", "Arm", "Motion", "Records"])
def test_a_group_that_is_left_out_is_noticed(path):
    lost = misplaced({name: analyzer for name, analyzer in analyzers().items() if analyzer["path"] != path})
    assert lost and not any(lost.values())


def test_a_diagnostic_in_two_groups_is_noticed():
    table = {**analyzers(), "twin": {"path": "Twin", "startswith": "left/jaka_driver"}}
    assert set(misplaced(table)) == {"left/jaka_driver: %s" % check for check in CHECKS}


def test_the_page_names_every_group():
    page = (ROOT / "docs" / "operation.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| (\w+) \| (.+?) \|$", page.split("| group | diagnostics |\n")[1].split("\n\n")[0], re.M)
    assert {group: sorted(checks.split(", ")) for group, checks in rows} == {
        analyzer["path"]: sorted(entry[2:] for entry in analyzer["contains"]) for analyzer in analyzers().values()}
