"""The commands as users start them, from the place under test: a devel or install space, the wheel, the Debian package.

``JAKA_TEST_PLACE`` names the place, and ``JAKA_TEST_PREFIX`` where it is:

==========  ===========================================================  ==============================================
checkout    files like those that the build makes, for the interpreter   no build, no ROS: a plain venv
            of the tests, with the packages of the checkout
devel       ``PREFIX/lib/jaka_ros_driver``, relays to the checkout       by default what the shell has sourced
install     the same, with packages of its own                           by default built
wheel       the console scripts in ``PREFIX/bin``; log tools only        by default built
deb         ``/usr/bin``; ``/usr/lib/jaka_ros_driver`` what only        no prefix
            rostest starts. dpkg must have installed them
==========  ===========================================================  ==============================================

Without ``JAKA_TEST_PLACE`` it is the devel space that the shell has sourced, if that is one of this checkout, else the
checkout. Commands of the other places see neither the checkout nor its devel space. With ``deb`` the tests themselves
import the packages' modules, too.
"""
import atexit
import fcntl
import functools
import hashlib
import importlib.util
import os
import re
import shutil
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path
from typing import Dict, Iterator, List, NamedTuple, Optional

from import_graph import PACKAGES, ROOT

PACKAGE = "jaka_ros_driver"
SYSTEM_PYTHON = "/usr/bin/python3"
BUILT = (Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "jaka_test_places"
         / hashlib.sha256(str(ROOT).encode()).hexdigest()[:12])
"""The folder where places are built and kept; not below the checkout, where roslaunch would find each launch file
twice."""
OF_A_SHELL = ("CMAKE_PREFIX_PATH", "PKG_CONFIG_PATH", "PYTHONPATH", "ROS_PACKAGE_PATH", "ROSLISP_PACKAGE_DIRECTORIES")
"""Variables by which a sourced space is found."""
LOG_COMMANDS = ("jaka_bag", "jaka_foxglove")
"""The executables in the wheel."""
DEBIAN_PACKAGES = ("jaka-panel", "python3-jaka-bag", "python3-jaka-ros-driver")
DEBIAN_MODULES = Path("/usr/lib/python3/dist-packages")


class Place(NamedTuple):
    """The place of the executables.

    Attributes:
        name: One of the names above.
        prefix: Its folder; None for the checkout, whose executables are written when they are needed.
    """

    name: str
    prefix: Optional[Path]

    @property
    def folder(self) -> Path:
        """The folder of the executables."""
        if self.prefix is None:
            return _commands_of_the_checkout()
        return self.prefix / ("bin" if self.name in ("wheel", "deb") else "lib/" + PACKAGE)

    @property
    def environment(self) -> Dict[str, Optional[str]]:
        """The variables that a user's shell has there; None for those that it lacks."""
        if self.name == "devel":
            return {}
        if self.name == "checkout":
            paths = [str(ROOT), str(ROOT / "tools"), *os.environ.get("PYTHONPATH", "").split(os.pathsep)]
            return {"PYTHONPATH": os.pathsep.join(path for path in dict.fromkeys(paths) if path)}
        if self.name == "install":
            return _sourced(self.prefix)
        return dict.fromkeys(OF_A_SHELL)


@functools.lru_cache(maxsize=None)
def place() -> Place:
    """Return the place under test."""
    name, prefix = os.environ.get("JAKA_TEST_PLACE"), os.environ.get("JAKA_TEST_PREFIX")
    sourced = _sourced_devel_space()
    if name is None:
        return Place("devel", sourced) if sourced else Place("checkout", None)
    if name == "checkout":
        return Place(name, None)
    if name == "devel":
        prefix = prefix or sourced
        if not prefix:
            raise RuntimeError("JAKA_TEST_PLACE=devel: no devel space of %s is sourced" % ROOT)
    elif name == "install":
        prefix = prefix or _kept("install", install_space)
    elif name == "wheel":
        prefix = prefix or _kept("wheel", wheel_venv)
    elif name == "deb":
        prefix = "/usr"
    else:
        raise RuntimeError("JAKA_TEST_PLACE=%s; it must be checkout, devel, install, wheel or deb" % name)
    return Place(name, Path(prefix))


def command_of(command: str) -> List[str]:
    """Return the words that start an executable of the place under test, without its arguments; its process stays one.

    Raises SkipTest where the wheel is not to have it, RuntimeError where the place lacks it.
    """
    where = place()
    path = where.folder / command
    if where.name == "wheel" and command not in LOG_COMMANDS:
        raise unittest.SkipTest("the wheel has the log tools only, and not %s" % command)
    if where.name == "deb" and not path.exists():
        path = where.prefix / "lib" / PACKAGE / command
    if not os.access(str(path), os.X_OK):
        raise RuntimeError("no command %s" % path)
    if where.name == "deb":
        require_packaged(path)
    changed = {name: value for name, value in where.environment.items() if os.environ.get(name) != value}
    words = []
    for name, value in changed.items():
        words += ["-u", name] if value is None else []
    words += ["%s=%s" % (name, value) for name, value in changed.items() if value is not None]
    return [*(["/usr/bin/env", *words] if words else []), str(path)]


def enter() -> None:
    """Give this process, and what it starts, the shell's variables of the checkout or install space under test.

    The packages of the wheel are in a venv of their own, which scripts for this interpreter do not see.
    """
    if place().name in ("checkout", "install"):
        for name, value in place().environment.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value
    if place().name in ("install", "wheel"):
        os.environ["JAKA_TEST_PREFIX"] = str(place().prefix)  # workers of a parallel run build nothing again


# ---- what dpkg has installed ----

@functools.lru_cache(maxsize=None)
def require_packaged(path: Path) -> None:
    """Raise RuntimeError unless this file is the one that a Debian package of this project has installed."""
    said = _dpkg("dpkg-query", "--search", str(path)).partition(":")[0]
    if said not in DEBIAN_PACKAGES:
        raise RuntimeError("%s is of %s" % (path, "the Debian package " + said if said else "no Debian package"))
    changed = [line.split()[-1] for line in _dpkg("dpkg", "--verify", said).splitlines()]
    if str(path.resolve()) in changed or any(name.endswith(".py") for name in changed):
        raise RuntimeError("not what the Debian package %s has installed: %s" % (said, ", ".join(changed)))


def _dpkg(*words: str) -> str:
    return subprocess.run(words, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True).stdout


def import_what_is_under_test() -> None:
    """Have this process, as well, import the modules of the Debian packages, and none of the checkout, in that place.

    Raises RuntimeError where that is not possible. Call it before anything of them is imported.
    """
    if place().name != "deb":
        return
    sys.path[:] = [folder for folder in sys.path if Path(folder).resolve() not in (ROOT, ROOT / "tools")]
    for name in PACKAGES:
        found = importlib.util.find_spec(name)
        if found is None or found.origin != str(DEBIAN_MODULES / name / "__init__.py"):
            raise RuntimeError("JAKA_TEST_PLACE=deb: %s is imported from %s" % (name, found and found.origin))


# ---- what the build makes ----

def declared() -> Dict[str, str]:
    """Return every executable of the build, with the ``module:function`` that it calls, from the root
    CMakeLists.txt."""
    text = (ROOT / "CMakeLists.txt").read_text(encoding="utf-8")
    rows = re.search(r"^set\(commands\n(.*?)\)$", text, re.DOTALL | re.MULTILINE).group(1)
    return dict(row.split("=", 1) for row in rows.split())


@functools.lru_cache(maxsize=None)
def _commands_of_the_checkout() -> Path:
    folder = Path(tempfile.mkdtemp(prefix="jaka_commands_"))
    atexit.register(shutil.rmtree, str(folder), ignore_errors=True)
    template = (ROOT / "cmake" / "command.py.in").read_text(encoding="utf-8")
    for name, called in declared().items():
        module, _, function = called.partition(":")
        values = {"PYTHON_EXECUTABLE": sys.executable, "command": name, "module": module, "function": function}
        path = folder / name
        path.write_text(re.sub(r"@(\w+)@", lambda found, values=values: values[found.group(1)], template),
                        encoding="utf-8")
        path.chmod(0o755)
    return folder


def _sourced_devel_space() -> Optional[Path]:
    """Return the first devel space on ``CMAKE_PREFIX_PATH`` that leads to this very checkout; a copy has no part in
    it."""
    for prefix in filter(None, os.environ.get("CMAKE_PREFIX_PATH", "").split(os.pathsep)):
        relay = Path(prefix, "lib", "python3", "dist-packages", "jaka_bag", "__init__.py")
        found = relay.is_file() and re.search(r"__extended_path = '(.*?)'", relay.read_text(encoding="utf-8"))
        if found and Path(found.group(1)).resolve() == ROOT / "tools":
            return Path(prefix)
    return None


# ---- places that are built ----

def _kept(name: str, build) -> Path:
    """Build a place in the folder that is kept for it, by one process at a time; return the prefix."""
    BUILT.mkdir(parents=True, exist_ok=True)
    with open(str(BUILT / (name + ".lock")), "w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        return build(BUILT / name)


def _run(*words, folder: Path, **variables: str) -> None:
    environment = {name: value for name, value in os.environ.items() if name not in OF_A_SHELL}
    done = subprocess.run([str(word) for word in words], cwd=str(folder), stdin=subprocess.DEVNULL, text=True,
                          stdout=subprocess.PIPE, stderr=subprocess.STDOUT, env={**environment, **variables})
    if done.returncode:
        raise RuntimeError("%s: exit %d\n%s" % (" ".join(map(str, words)), done.returncode, done.stdout))


def install_space(folder: Path) -> Path:
    """Build an install space from the checkout; return the prefix, beside whose packages nothing else is."""
    folder.mkdir(parents=True, exist_ok=True)
    prefix = folder / "prefix"
    shutil.rmtree(str(prefix), ignore_errors=True)
    _run("cmake", "-S", ROOT, "-B", folder / "build", "-Wno-dev", "-DCMAKE_INSTALL_PREFIX=%s" % prefix,
         "-DCATKIN_DEVEL_PREFIX=%s" % (folder / "devel"), "-DPYTHON_EXECUTABLE=%s" % sys.executable,
         "-DCATKIN_ENABLE_TESTING=OFF", folder=folder, ROS_LANG_DISABLE="geneus:genlisp:gennodejs")
    _run("cmake", "--build", folder / "build", "--target", "install", folder=folder)
    return prefix


def wheel_venv(folder: Path, extras: str = "[fleet,foxglove,plot]") -> Path:
    """Make the wheel of the log tools, and a venv that has it with what it needs, and nothing of the system."""
    folder.mkdir(parents=True, exist_ok=True)
    shutil.rmtree(str(folder / "tools"), ignore_errors=True)
    for old in folder.glob("*.whl"):
        old.unlink()
    shutil.copytree(str(ROOT / "tools"), str(folder / "tools"), ignore=shutil.ignore_patterns("__pycache__", "build"))
    pip = [sys.executable, "-m", "pip", "--disable-pip-version-check", "--no-input"]
    venv = folder / "venv"
    _run(*pip, "wheel", "--no-deps", "--wheel-dir", folder, folder / "tools", folder=folder)
    wheel, = folder.glob("jaka_bag-*.whl")
    if not (venv / "bin" / "python").exists():
        _run(SYSTEM_PYTHON, "-m", "venv", "--without-pip", venv, folder=folder)
    into = [*pip, "--python", venv / "bin" / "python", "install", "--no-compile"]
    _run(*into, "%s%s" % (wheel, extras), folder=folder)
    _run(*into, "--no-deps", "--force-reinstall", wheel, folder=folder)  # one of the same version, from before
    return venv


@functools.lru_cache(maxsize=None)
def _sourced(prefix: Path) -> Dict[str, Optional[str]]:
    """Return the variables of ``OF_A_SHELL`` in a shell that has sourced this space and no other."""
    environment = {name: value for name, value in os.environ.items() if name not in OF_A_SHELL}
    said = subprocess.run(["bash", "-c", ". '%s/setup.bash' && exec /usr/bin/env -0" % prefix], env=environment,
                          stdout=subprocess.PIPE, check=True).stdout.decode()
    found = dict(_pairs(said))
    return {name: found.get(name) for name in OF_A_SHELL}


def _pairs(text: str) -> Iterator[List[str]]:
    for line in text.split("\0"):
        if "=" in line:
            yield line.split("=", 1)
