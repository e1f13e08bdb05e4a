"""Fixtures that build the package in temporary folders, and shells that have sourced them."""
import os
import subprocess
import sys
from pathlib import Path
from typing import Callable, Sequence

import import_graph
import pytest

Shell = Callable[..., "subprocess.CompletedProcess[str]"]


def clean_environment(home: Path) -> "dict[str, str]":
    """Return an environment with nothing of the shell that runs the tests: no other workspace, no other interpreter."""
    return {"PATH": "/usr/bin:/bin", "HOME": str(home), "ROS_HOME": str(home), "LANG": "C.UTF-8",
            "ROS_LANG_DISABLE": "geneus:genlisp:gennodejs"}


@pytest.fixture(scope="session")
def shell(tmp_path_factory) -> Shell:
    """Return a function that runs a bash command: ``shell(command, setup=FILE, cwd=FOLDER, VARIABLE=VALUE)``.

    It returns the result, checked or not.
    """
    home = tmp_path_factory.mktemp("home")

    def run(command, setup=None, cwd=None, check=True, **variables):
        if setup is not None:
            command = ". '%s' && %s" % (setup, command)
        result = subprocess.run(["bash", "-c", command], cwd=str(cwd or home), text=True, timeout=240,
                                stdout=subprocess.PIPE, stderr=subprocess.STDOUT, stdin=subprocess.DEVNULL,
                                env={**clean_environment(home), **variables})
        assert not check or result.returncode == 0, "%s: exit %d\n%s" % (command, result.returncode, result.stdout)
        return result

    return run


@pytest.fixture(scope="session")
def make_workspace(tmp_path_factory) -> Callable[..., Path]:
    """Return a function that makes a catkin workspace with links to the checkout and to named folders beside this
    file."""
    def make(*folders: str) -> Path:
        workspace = tmp_path_factory.mktemp("workspace")
        source = workspace / "src"
        source.mkdir()
        os.symlink(str(import_graph.ROOT), str(source / "jaka_ros_driver"))
        for folder in folders:
            os.symlink(str(Path(__file__).with_name(folder)), str(source / folder))
        return workspace

    return make


@pytest.fixture(scope="session")
def cmake_options() -> Sequence[str]:
    """Return the options that choose the interpreter of the tests, which has what the executables need."""
    return ("-DPYTHON_EXECUTABLE=" + sys.executable, "-DCATKIN_ENABLE_TESTING=OFF", "-Wno-dev")
