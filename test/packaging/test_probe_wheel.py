"""The wheel of jaka_probe: in a bare venv of each Python that is here, probes a simulated controller."""
import contextlib
import json
import os
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest
from command_places import OF_A_SHELL, SYSTEM_PYTHON
from import_graph import ROOT, imported_names, modules, parse

from jaka_ros_driver import __version__

PROJECT = ROOT / "tools" / "probe"
WAIT = 120
PIP = [sys.executable, "-m", "pip", "--disable-pip-version-check", "--no-input"]
NEEDED = {"mcap", "numpy", "pyyaml", "lz4", "zstandard"}
"""Packages that a venv holds beside it; the last two are those of mcap."""


def interpreters():
    """Return the Pythons of this computer that the project is tested with, by version."""
    found = {"system": SYSTEM_PYTHON}
    for version in ("3.8", "3.13"):
        kept = sorted(Path(os.environ.get("PYENV_ROOT") or Path.home() / ".pyenv").glob(
            "versions/%s.*/bin/python" % version))
        path = str(kept[-1]) if kept else shutil.which("python" + version)
        if path and subprocess.run([path, "-c", "import venv"], stderr=subprocess.DEVNULL).returncode == 0:
            found[version] = path
    return found


def pip_of(python):
    """Return the words that start pip for a venv: its own one, where it has one; else that of this Python."""
    has_own = subprocess.run([str(python), "-c", "import pip"], stderr=subprocess.DEVNULL).returncode == 0
    return [str(python), *PIP[1:]] if has_own else [*PIP, "--python", str(python)]


def call(*words, folder="/", code=0, **more):
    environment = {name: value for name, value in os.environ.items() if name not in OF_A_SHELL}
    done = subprocess.run([str(word) for word in words], cwd=str(folder), stdin=subprocess.DEVNULL, text=True,
                          stdout=subprocess.PIPE, stderr=subprocess.STDOUT, timeout=WAIT, env=environment, **more)
    assert done.returncode == code, done.stdout
    return done.stdout


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    """Return the wheel, built from what of the checkout belongs to it."""
    folder = tmp_path_factory.mktemp("wheel")
    call(*PIP, "wheel", "--no-deps", "--wheel-dir", folder, PROJECT, folder=folder)
    made, = folder.glob("*.whl")
    return made


@pytest.fixture(scope="module", params=interpreters().items(), ids=lambda one: one[0])
def installed(request, wheel, tmp_path_factory):
    """Return the ``bin`` folder of a venv with the wheel and what it needs, and nothing of the system."""
    venv = tmp_path_factory.mktemp("venv")
    has_pip = subprocess.run([request.param[1], "-c", "import ensurepip"], stderr=subprocess.DEVNULL).returncode == 0
    call(request.param[1], "-m", "venv", *([] if has_pip else ["--without-pip"]), venv)
    call(*pip_of(venv / "bin" / "python"), "install", "--no-compile", wheel)
    return venv / "bin"


def test_all_that_its_modules_import_is_in_it(wheel):
    names = set(zipfile.ZipFile(wheel).namelist())
    sources = [name for name in names if name.endswith(".py")]
    assert len(sources) > 100 and "jaka_ros_driver/kinematics/data/models.yaml" in names
    assert not [name for name in names if "__pycache__" in name or name.endswith(".pyc")]
    wanted = {modules()[other].relative_to(ROOT).as_posix() for name in sources
              for other in imported_names(parse(ROOT / name), (ROOT / name).parent) if other in modules()}
    assert not {path for path in wanted if path.endswith(".py")} - names


def test_it_brings_no_ros_and_little_else(installed):
    call(installed / "python", "-c", "import rospy", code=1)
    told = call(*pip_of(installed / "python"), "list", "--format", "freeze").lower().split()
    names = {name.partition("==")[0] for name in told if "==" in name}
    assert names - {"pip", "setuptools"} == NEEDED | {"jaka-probe"}
    code = "import jaka_ros_driver as one; print(one.__version__, one.__file__)"
    version, path = call(installed / "python", "-c", code).split()
    assert version == __version__ and str(installed.parent) in path
    assert (Path(path).parent / "LICENSE").read_bytes() == (ROOT / "LICENSE").read_bytes()


def test_it_probes_a_controller_and_simulates_one_like_it(installed, tmp_path):
    with contextlib.ExitStack() as stack:
        def start(*words):
            process = stack.enter_context(subprocess.Popen(
                [installed / "jaka_sim", *(word for port in ("command", "status", "poll")
                                           for word in ("--%s-port" % port, "0")), "--start", "enabled", *words],
                stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True, cwd="/"))
            stack.callback(process.terminate)
            return json.loads(process.stdout.readline())

        def probe(folder, ports):
            return call(installed / "jaka_probe", "127.0.0.1", "--out", tmp_path / folder, "--seconds", "1.5",
                        "--stage", "set", *(word for port in ("command", "status", "poll")
                                 for word in ("--%s-port" % port, ports[port + "_port"])))

        told = probe("arm", start("--firmware", "1.7.2"))
        assert "jaka_sim --like" in told and (tmp_path / "arm" / "wire.mcap").stat().st_size > 1000
        report = tmp_path / "arm" / "probe.json"
        facts = json.loads(report.read_text())["facts"]
        assert "zu7" in facts["model"]["value"] and len(facts["same_values"]["value"]) == 4
        probe("twin", start("--like", report))
    told = call(installed / "jaka_probe", "diff", report, tmp_path / "twin" / "probe.json")
    assert [line for line in told.splitlines() if "not settled" not in line] in ([], ["  no difference"])
    assert "Settled" in call(installed / "jaka_probe", "explain", report)


def test_its_guard_process_starts(installed):
    code = ("from jaka_ros_driver.client.guard import Guard\nimport time\nguard = Guard('127.0.0.1', 1, 2)\n"
            "end = time.monotonic() + 20\nwhile not guard.health().is_alive and time.monotonic() < end:\n"
            "    guard.beat(time.monotonic())\n    time.sleep(0.02)\nprint(guard.health().is_alive)\nguard.close()")
    assert call(installed / "python", "-c", code).split()[-1] == "True"
