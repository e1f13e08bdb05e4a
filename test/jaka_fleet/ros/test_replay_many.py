"""A golden log replayed against a changed driver.

``test/soak/soak_fleet.py`` replays all of them on the workers of a cluster, one of which is killed in mid-stage.
"""
import json
import os
import shutil
from xml.etree import ElementTree

from import_graph import ROOT

from jaka_bag.cli.main import main

GOLDEN = ROOT / "test" / "data" / "golden"
RIGHT = "return state.tcp_position + rotation_vector_from_rpy"
WRONG = "return state.tcp_position[:2] + (state.tcp_position[2] + 0.05,) + rotation_vector_from_rpy"


def test_a_changed_driver_is_found(tmp_path, capsys):
    shutil.copytree(str(ROOT / "jaka_ros_driver"), str(tmp_path / "changed" / "jaka_ros_driver"),
                    ignore=shutil.ignore_patterns("__pycache__"))
    convert = tmp_path / "changed" / "jaka_ros_driver" / "ros" / "convert.py"
    text = convert.read_text(encoding="utf-8")
    assert text.count(RIGHT) == 1
    convert.write_text(text.replace(RIGHT, WRONG), encoding="utf-8")
    code = main(["replay", str(GOLDEN / "io_sequence.mcap"), "--against-driver", str(tmp_path / "changed"),
                 "--jobs", "1", "--json", "--time-scale", "4",
                 "--tolerances", str(ROOT / "test" / "data" / "busy_host.yaml"),
                 "-o", str(tmp_path / "reports"), "--junit", str(tmp_path / "junit.xml")])
    found = {one["folder"]: one for one in json.loads(capsys.readouterr().out)["replays"]}
    assert code == 1 and set(found) == {"io_sequence"}
    assert found["io_sequence"]["verdict"] == "different", found
    assert any("tool_position position" in name for name in found["io_sequence"]["differences"]), found
    suite = ElementTree.fromstring((tmp_path / "junit.xml").read_bytes()).find("testsuite")
    assert suite.get("failures") == "1" and suite.get("errors") == "0"
    page = (tmp_path / "reports" / "report.html").read_text(encoding="utf-8")
    assert 'href="io_sequence/report.html"' in page and str(tmp_path / "changed") in page
    kept = set(os.listdir(str(tmp_path / "reports" / "io_sequence")))
    assert {"report.html", "report.xml", "report.json", "candidate.mcap", "driver0.log"} <= kept
