"""The reports in docs/probes: each is one of jaka_probe and nothing else, and names no arm, computer or person."""
import json
import re
from pathlib import Path

import pytest

from jaka_ros_driver.kinematics.arm_models import model_names
from jaka_ros_driver.probe import report
from jaka_ros_driver.probe.facts import DESCRIBED, Fact, ProbeStage
from jaka_ros_driver.probe.identity import identity_in

FOLDER = Path(__file__).resolve().parents[2] / "docs" / "probes"
NAME = re.compile(r"(\d+\.\d+\.\d+)_(%s)_[a-z]\.json" % "|".join(model_names()))
FACTS = {"version": Fact("1.7.2.16", "as it answers"), "model": Fact(["zu7"], "nearest is zu7, 0.04 mm away"),
         "unknown_command": Fact("code 1, without a name", "Exception:function call failed"),
         "frame_fields_unknown": Fact(["ctrl_cycle", "vendor_block"], "132 frames in 30.0 s"),
         "feed_period": Fact(0.03001, "mean of 1000 frames in 30.0 s", "98 of 100 pauses are 0.0281 to 0.0312")}


def why_not(name, content):
    """Return what speaks against a file in the folder; an empty list for nothing."""
    found = [] if NAME.fullmatch(name) else ["its name is not FIRMWARE_MODEL_LETTER.json"]
    known = report.as_json({}, [], True)
    found += ["%s does not belong into a report" % key for key in sorted(set(content) - set(known))]
    found += ["%s is no fact" % key for key in sorted(set(content["facts"]) - set(DESCRIBED))]
    row = set(Fact._fields) | {"unit", "meaning"}
    found += ["fact %s has %s" % (key, sorted(set(fact) - row)) for key, fact in content["facts"].items()
              if set(fact) - row]
    return found + identity_in(content)


def content_of(facts=None, **changes):
    made = report.as_json(facts or FACTS, [ProbeStage.LOOK], True, curves={"move": [(0.0, 1.25)]})
    return {**json.loads(json.dumps(made)), **changes}


@pytest.mark.parametrize("path", sorted(FOLDER.iterdir()), ids=lambda path: path.name)
def test_a_report_of_somebody_is_one_and_names_nobody(path):
    if path.name != "README.md":
        assert not why_not(path.name, report.read(str(path)))


def test_a_report_as_the_probe_writes_it_belongs_there():
    assert why_not("1.7.2_zu7_a.json", content_of()) == []


@pytest.mark.parametrize("text, kind", [
    ("the status port 10000 of 192.168.1.20: refused", "an address"), ("fe80::1ff:fe23:4567:890a", "an address"),
    ("eth0 is 00:1B:44:11:3A:B7", "a hardware address"), ("001b44113ab7", "a hardware address"),
    ("[Errno -2] cell-pc.local is no address", "a host name"), ("http://robots/arm", "a host name"),
    ("written by anna@line3", "a user name"), ("/users/anna/probe", "a user name"),
    ("arm JK2023-00417", "a serial number"), ("number 20231104", "a serial number"),
    ("JAKA-Zu7-0042 answers", "the name of an arm"), ("arm jaka_zu12_03", "the name of an arm"),
    ("JAKA Pro16-A7", "the name of an arm"), ("SN 7A", "a serial number"), ("S/N: 0042B", "a serial number"),
    ("sn=7A3", "a serial number"), ("Serial no. 12", "a serial number"), ("pc-halle3:10001", "a port of a host"),
    ("refused by cell7:10000", "a port of a host"),
    ('"robot_name": "Bob"', "a name"), ("robot name is Bob", "a name"), ("serial: 7A", "a name")])
@pytest.mark.parametrize("place", ["how", "spread", "value"])
def test_identity_that_was_left_in_a_text_is_found(text, kind, place):
    facts = {**FACTS, "unknown_command": FACTS["unknown_command"]._replace(**{place: "beside " + text + " there"})}
    assert [line for line in why_not("1.7.2_zu7_a.json", content_of(facts)) if ": %s, " % kind in line]


@pytest.mark.parametrize("text", [
    "jaka_probe 0.3.0", "jaka_sim --like my_arm/probe.json", "get_version: 12 of 18", "code 1: get_motion_state",
    "step 3: 25 frames", "it answers at 10:42:07", "port 10004: connection refused", "set_tool_id: 15 reads back",
    "98 of 100 pauses are 0.0281 to 0.0312", "code 1, which names it", "SN xxxx",
    "ctrl_cycle, in cycles of 8 ms", "jaka_ros_driver", "the snap of 12 frames", "list of 6: number"])
def test_ordinary_words_of_a_report_are_no_identity(text):
    facts = {**FACTS, "unknown_command": FACTS["unknown_command"]._replace(how=text)}
    assert why_not("1.7.2_zu7_a.json", content_of(facts)) == []


def test_identity_is_found_in_keys_numbers_and_what_was_not_set_back():
    for changes in ({"robot_id": 7734}, {"robot_id": "7734"}, {"10.5.5.100": {}}, {"owner": "anna"},
                    {"not_set_back": ["user frame 3 of 10.5.5.100"]}, {"made_by": "jaka_probe on cell.local"}):
        assert why_not("1.7.2_zu7_a.json", content_of(**changes)), changes
    assert identity_in({"robot_name": "xxxx", "robot_id": "0000", "serial_number": "xx"}) == []
    named = content_of()
    named["facts"]["version"]["serial"] = "xx"
    assert why_not("1.7.2_zu7_a.json", named) == ["fact version has ['serial']"]
    assert why_not("annas_arm.json", content_of())
