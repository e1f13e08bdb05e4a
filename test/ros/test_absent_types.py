"""Every type of jaka_msgs taken away in turn, from our package and from the maker's: the driver offers the rest.

The maker's published definitions, as facts, and their md5 (test/support/published_messages.py).
"""
import json
import os
import subprocess
import sys
from pathlib import Path

import genmsg.gentools
import genmsg.msg_loader
import pytest
from import_graph import ROOT
from published_messages import MESSAGES, REQUESTS, SERVICES, STATES, generate

import jaka_msgs
from jaka_msgs import msg as messages
from jaka_msgs import srv as services
from jaka_ros_driver.ros.services.table import SERVICES as TABLE

OURS = {path.stem: path.suffix for kind in ("msg", "srv", "action") for path in (ROOT / "jaka_msgs" / kind).iterdir()}
USERS = {"IOBank": ["IOStates"], "PathSegment": ["MovePath"]}
"""Types that have another one as a field: they cannot be there without it."""
LOST = {"ServiceCall": "~service_calls", "IOStates": "~io_states", "MotionState": "~motion_state",
        "ProgramState": "~program/state", "RobotMsg": "~robot_states", "Recover": "~recover", "MovePath": "~move_path"}
"""Topics and actions that cannot be offered without a message or an action."""


def md5_of(kind, name, text):
    context = genmsg.MsgContext.create_default()
    load = getattr(genmsg.msg_loader, "load_%s_from_string" % kind)
    return genmsg.gentools.compute_md5(context, load(context, text, "jaka_msgs/" + name))


def test_the_md5_of_every_published_definition_is_that_of_ours():
    for name, (request, response, md5sum) in SERVICES.items():
        assert md5_of("srv", name, request + "---\n" + response) == md5sum, name
        assert getattr(services, name)._md5sum == md5sum, name
        assert getattr(services, name)._request_class._md5sum == REQUESTS.get(name, md5_of("msg", name, request)), name
    for name, (text, md5sum) in MESSAGES.items():
        assert md5_of("msg", name, text) == md5sum == getattr(messages, name)._md5sum, name


def test_the_stand_in_of_the_other_tests_is_a_published_package():
    folder = ROOT / "test" / "packaging" / "other_jaka_msgs"
    assert {path.stem: path.read_text().split() for kind in ("srv", "msg")
            for path in (folder / kind).iterdir()} == {
        **{name: (request + "---\n" + response).split() for name, (request, response, _) in SERVICES.items()},
        **{name: text.split() for name, (text, _) in MESSAGES.items()}}


def without(folder, name, source):
    """Make the package in ``source`` without a type, and without those that have it as a field."""
    package = folder / "jaka_msgs"
    gone = [name, *USERS.get(name, [])] if name else []
    for kind in ("msg", "srv"):
        (package / kind).mkdir(parents=True)
        kept = []
        for path in sorted((source / kind).glob("_*.py")):
            is_gone = any(path.stem == "_" + one or OURS.get(one) == ".action" and path.stem.startswith("_" + one)
                          for one in gone)
            if path.stem != "__init__" and not is_gone:
                os.symlink(str(path), str(package / kind / path.name))
                kept.append(path.stem)
        (package / kind / "__init__.py").write_text("".join("from .%s import *\n" % module for module in kept))
    (package / "__init__.py").touch()
    return gone


def offers(folders):
    done = subprocess.run([sys.executable, str(ROOT / "test" / "support" / "absent_types.py"), *map(str, folders)],
                          stdout=subprocess.PIPE, text=True, timeout=120)
    assert done.returncode == 0
    return [json.loads(line) for line in done.stdout.splitlines()]


def expected_services(there):
    """Return names and types of the services that these types suffice for."""
    found = {}
    for spec in TABLE:
        package, kind = spec.srv_type._type.split("/")
        if spec.name == "clear_err" and "ClearErr" not in there:
            kind = "ClearError"
        if package != "jaka_msgs" or kind in there:
            found["~" + spec.name] = package + "/" + kind
    return found


def faults(offer, there):
    """Return what is wrong with what is offered where these types are there."""
    if "error" in offer:
        return [offer["error"]]
    absent = [name for name in OURS if name not in there and name not in USERS]
    wrong = ["services: %s" % offer["services"]] if offer["services"] != expected_services(there) else []
    for name, place in LOST.items():
        is_offered = place in offer["topics"] + offer["actions"]
        if is_offered != (name in there):
            wrong.append("%s: %s" % (name, offer["topics"]))
    for name in absent:
        if len([line for line in offer["warnings"] if " no %s:" % name in line or " no action %s:" % name in line
                or " no %s," % name in line]) != 1:
            wrong.append("%s is not named once: %s" % (name, offer["warnings"]))
    return wrong + ["too many: %s" % offer["warnings"]] * (len(offer["warnings"]) != len(absent))


@pytest.fixture(scope="module")
def variants(tmp_path_factory):
    """Return, by a title, the folder of each package and the types in it."""
    found = {}
    ours = Path(jaka_msgs.__path__[0])
    for name in ("", *sorted(OURS)):
        folder = tmp_path_factory.mktemp("ours")
        gone = without(folder, name, ours)
        found["ours without %s" % (name or "nothing")] = folder, set(OURS) - set(gone)
    for number, (state, types) in enumerate(sorted(STATES.items())):
        folder = generate(tmp_path_factory.mktemp("published"), types)
        found[state] = folder, types
        for name in sorted(types) if not number else ():
            less = tmp_path_factory.mktemp("less")
            without(less, name, folder / "jaka_msgs")
            found["%s without %s" % (state, name)] = less, types - {name}
    return found


def test_whatever_type_is_absent_the_rest_is_offered_and_each_is_named_once(variants):
    results = offers([folder for folder, _ in variants.values()])
    assert len(results) == len(variants)
    wrong = {title: faults(offer, there) for (title, (_, there)), offer in zip(variants.items(), results)}
    assert {title: found for title, found in wrong.items() if found} == {}


def test_a_module_that_cannot_do_without_a_type_is_found(variants):
    titles = ["ours without Move", "ours without ServoMove"]
    for title in titles:
        planted = variants[title][0] / "planted"
        planted.mkdir()
        (planted / "planted.py").write_text("from jaka_msgs.srv import Move\n")
    first, second = [faults(offer, variants[title][1])
                     for title, offer in zip(titles, offers([variants[title][0] for title in titles]))]
    assert "cannot import name 'Move'" in first[0] and not second
