"""Files that belong to the packages, beside their modules: all are in the place under test, and are found there."""
import hashlib
import json
import subprocess
from pathlib import Path

import pytest
from command_places import DEBIAN_MODULES, LOG_COMMANDS, command_of, place
from import_graph import LOG_TOOLS, PACKAGES, ROOT

HASHES = """
import hashlib, importlib, json, os, sys
found = []
for package, name in json.loads(sys.argv[1]):
    paths = [os.path.join(folder, name) for folder in importlib.import_module(package).__path__]
    paths = [path for path in paths if os.path.isfile(path)]
    found.append(hashlib.sha256(open(paths[0], "rb").read()).hexdigest() if paths else "missing")
print(json.dumps([found, [os.path.realpath(importlib.import_module(name).__path__[-1]) for name in sys.argv[2:]]]))
"""
USES = {
    "the table of arms": "from jaka_ros_driver.kinematics.arm_models import load_model; assert load_model('zu7').dh",
    "the black box's copy of it": "from jaka_blackbox.evidence import Evidence\n"
                                  "names = [one.name for one in Evidence('', '', '', dict).attachments()]\n"
                                  "assert 'arm_models.yaml' in names, names",
    "the panel's page": "from jaka_panel.pages.files import page_file\n"
                        "assert b'<html' in page_file('index.html').path.read_bytes()\n"
                        "assert page_file('icon.svg')",
}
"""Files that the executables read, by the functions with which they do."""


def packages():
    return [name for name in PACKAGES if place().name != "wheel" or name in LOG_TOOLS]


def in_the_place(code, *words):
    """Run a script with the interpreter of the place's executables, in a folder that has nothing to do with them."""
    *before, program = command_of(LOG_COMMANDS[0])
    with open(program, encoding="utf-8") as file:
        interpreter = file.readline()[2:].strip()
    done = subprocess.run([*before, interpreter, "-c", code, *words], cwd="/", capture_output=True,
                          text=True, timeout=100)
    assert done.returncode == 0, done.stderr
    return done.stdout


def files_of(package):
    """Return the package's files in the checkout that are no Python, relative to the package's folder."""
    folder = PACKAGES[package]
    return sorted(path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()
                  and path.suffix not in (".py", ".pyc") and not any(part.startswith(".") for part in path.parts))


def test_every_file_of_the_packages_is_there_byte_by_byte():
    wanted = [(package, name) for package in packages() for name in files_of(package)]
    expected = [hashlib.sha256((PACKAGES[package] / name).read_bytes()).hexdigest() for package, name in wanted]
    found, folders = json.loads(in_the_place(HASHES, json.dumps(wanted), *packages()))
    assert [one for one, has, should in zip(wanted, found, expected) if has != should] == []
    assert len(wanted) > 20 or place().name == "wheel"
    if place().name in ("install", "wheel", "deb"):
        assert not [folder for folder in folders if Path(folder) in PACKAGES.values()], "it is the checkout's"
    if place().name == "deb":
        assert folders == [str(DEBIAN_MODULES / name) for name in packages()]


def test_a_file_that_is_missing_is_seen():
    (found,), _ = json.loads(in_the_place(HASHES, json.dumps([("jaka_bag", "no/such.file")])))
    assert found == "missing"


@pytest.mark.parametrize("what", sorted(USES))
def test_programs_find_what_they_read(what):
    if place().name == "wheel":
        pytest.skip("belongs to the ROS package")
    if "jaka_panel" in USES[what]:
        pytest.importorskip("aiohttp")
    in_the_place(USES[what])


def test_no_module_looks_beside_the_file_that_was_started():
    # In a devel space that file is a relay.
    found = [path.relative_to(ROOT).as_posix() for folder in PACKAGES.values() for path in folder.rglob("*.py")
             if "sys.argv[0]" in path.read_text(encoding="utf-8")]
    assert not found
