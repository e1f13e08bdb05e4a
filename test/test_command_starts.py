"""The starts of executables in tests, benchmarks and pages: by their files, never as modules of a checkout."""
import re
import shutil
import subprocess
from pathlib import Path

import command_places
import pytest
from import_graph import ROOT, modules, outside_imports

WHERE = ("test", "docs", "tools", "launch", ".ci", "README.md", "CONTRIBUTING.md", "CMakeLists.txt")
SUFFIXES = ("", ".cmake", ".launch", ".md", ".mjs", ".py", ".sh", ".test", ".txt")
UNBUILT = {"docs/simulation.md", "test/packaging/test_spaces.py"}
"""Files about the simulated controller of a checkout that is not built."""
MODULES = sorted({called.split(":")[0] for called in command_places.declared().values()}
                 | {name for name in modules() if name.endswith(".__main__")}
                 | {name.rpartition(".")[0] for name in modules() if name.endswith(".__main__")})
"""Modules that are the executable when they are run."""
START = re.compile(r"""-m["']?,?\s*["']?(%s)(?![\w.])""" % "|".join(map(re.escape, MODULES)))


def starts(text):
    """Return the modules that a text starts as executables."""
    return START.findall(text)


def files():
    for name in WHERE:
        for path in sorted((ROOT / name).rglob("*")) if (ROOT / name).is_dir() else [ROOT / name]:
            if path.is_file() and path.suffix in SUFFIXES:
                yield path


def test_nothing_starts_a_command_as_a_module():
    found = {path.relative_to(ROOT).as_posix(): starts(path.read_text(encoding="utf-8")) for path in files()
             if path != Path(__file__).resolve()}
    assert len(found) > 300
    assert {name: what for name, what in found.items() if what and name not in UNBUILT} == {}
    assert {what for name in UNBUILT for what in found[name]} == {"jaka_ros_driver.simulation"}


@pytest.mark.parametrize("planted, module", [
    ('[sys.executable, "-m", "jaka_bag", *words]', "jaka_bag"), ("python3 -m jaka_bag info", "jaka_bag"),
    ("(\"-m\",\n 'jaka_bag.__main__')", "jaka_bag.__main__"), ('"-m", "jaka_panel.command"]', "jaka_panel.command"),
    ("`python3 -m jaka_ros_driver.simulation`", "jaka_ros_driver.simulation"),
    ("python3 -m jaka_ros_driver.wire.replayer", None), ("python3 -m jaka_fleet.replay.stage_process", None)])
def test_a_start_that_is_planted_is_seen(planted, module):
    assert starts(planted) == ([module] if module else [])


# ---- the place under test ----

@pytest.mark.parametrize("executable", sorted(command_places.declared()))
def test_every_command_is_in_the_place_under_test(executable):
    # It starts from a folder that has nothing to do with the checkout.
    if "rospy" in outside_imports(command_places.declared()[executable].split(":")[0]):
        pytest.importorskip("rospy", reason="%s needs ROS" % executable)
    done = subprocess.run([*command_places.command_of(executable), "--help"], cwd="/", stdout=subprocess.PIPE,
                          stderr=subprocess.STDOUT, text=True, timeout=100)
    assert done.returncode == 0 and done.stdout.startswith("usage: %s" % executable), done.stdout


@pytest.mark.skipif(shutil.which("dpkg-query") is None, reason="needs dpkg")
def test_a_command_that_is_no_package_of_ours_is_not_taken_for_one(tmp_path):
    planted = tmp_path / "jaka_bag"
    planted.write_text("#!/bin/sh\necho usage: jaka_bag\n", encoding="utf-8")
    with pytest.raises(RuntimeError, match="of no Debian package"):
        command_places.require_packaged(planted)
    with pytest.raises(RuntimeError, match="of the Debian package dpkg"):
        command_places.require_packaged(Path(shutil.which("dpkg-query")))
