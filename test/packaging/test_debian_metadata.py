"""Dependencies of the Debian packages against what the code imports: nothing that is imported is missing."""
import configparser
import os
import pathlib
import re
import shutil
import subprocess
import sys

import pytest
from import_graph import LOG_TOOLS, PACKAGES, ROOT, at_import, imported_names, parse

DEBIAN = ROOT / "tools" / "debian" / "package"
CONTENTS = {"python3-jaka-bag": list(LOG_TOOLS),
            "python3-jaka-ros-driver": ["jaka_ros_driver", "jaka_migration", "jaka_regression"],
            "jaka-panel": ["jaka_panel"]}
NOT_IN_DEBIAN = {
    "control_msgs", "industrial_msgs",  # their messages are made from definitions where they are missing
    "dask", "duckdb", "fsspec", "ray",  # data sets of jaka_bag; distributed, which Debian has, brings dask and fsspec
    "ompl", "ruckig", "toppra",  # the simulated arm moves in trapezoids without ruckig
}
GUARDED = {  # imported only for a part of the tools, which reports where they are missing
    "python3-jaka-bag": {"aiohttp", "cryptography", "distributed", "matplotlib", "mpl_toolkits", "pyarrow"},
    "python3-jaka-ros-driver": {"prometheus_client", "pytest", "rosunit"},  # ~metrics_port, a plugin, rostest
    "jaka-panel": set(),
}
OF_PYTHON3_ROSLIB = {"roslib"}  # which rospy depends on


def paragraphs():
    """Return the values of its fields for each binary package."""
    found = {}
    for text in (DEBIAN / "control").read_text(encoding="utf-8").split("\n\n")[1:]:
        fields = dict(re.findall(r"^([\w-]+):((?:.*\n?)(?: .*\n?)*)", text, re.MULTILINE))
        found[fields["Package"].strip()] = fields
    return found


@pytest.fixture(scope="module")
def substituted():
    """Return values of the variables in debian/control, as far as the packages' own metadata give them."""
    printed = subprocess.run([sys.executable, str(DEBIAN / "ros_depends.py"), str(ROOT / "package.xml")], check=True,
                             stdout=subprocess.PIPE, text=True).stdout
    return dict(line.split("=", 1) for line in printed.splitlines())


def wheel_requirements():
    text = (ROOT / "tools" / "pyproject.toml").read_text(encoding="utf-8")
    block = re.search(r"^dependencies = \[\n(.*?)^\]", text, re.MULTILINE | re.DOTALL).group(1)
    names = re.findall(r'^  "([\w-]+)', block, re.MULTILINE)
    return {"python3-" + {"pyyaml": "yaml"}.get(name, name) for name in names}


def names_in(package, fields, substituted):
    """Return names of packages in these fields, and in those of this project's packages that it depends on."""
    names = set()
    for field in fields:
        value = paragraphs()[package].get(field, "")
        value = re.sub(r"\$\{([\w:]+)\}", lambda found: substituted.get(found.group(1), ""), value)
        names |= {part.split()[0] for part in value.split(",") if part.strip()}
    if package == "python3-jaka-bag" and "Depends" in fields:
        names |= wheel_requirements()
    for other in names & set(CONTENTS):
        if other != "jaka-panel":
            names |= names_in(other, fields, substituted)
    return names


STANDARD = frozenset(getattr(sys, "stdlib_module_names", ()))
needs_standard = pytest.mark.skipif(not STANDARD, reason="Python names the modules of its own library since 3.10")


def roots(package, tree_of):
    """Return top-level modules from outside this project and the standard library, each with a file that imports it."""
    found = {}
    for name in CONTENTS[package]:
        for path in sorted(PACKAGES[name].rglob("*.py")):
            tree = tree_of(parse(path))
            words = set(imported_names(tree, path.parent))
            words |= set(re.findall(r'import_module\("([\w.]+)"\)', path.read_text(encoding="utf-8")))
            found.update((word.split(".")[0], path) for word in words)
    own = set(PACKAGES) | STANDARD | {"jaka_msgs"} | OF_PYTHON3_ROSLIB
    return {root: path for root, path in found.items() if root not in own}


def debian_name(root):
    return "python3-" + {"mpl_toolkits": "matplotlib"}.get(root, root).replace("_", "-")


@needs_standard
@pytest.mark.parametrize("package", sorted(CONTENTS))
def test_what_a_module_imports_when_it_is_imported_is_a_dependency(package, substituted):
    depends = names_in(package, ["Depends"], substituted)
    needed = roots(package, at_import)
    assert len(needed) >= 2
    assert not {root: str(path) for root, path in needed.items()
                if debian_name(root) not in depends and root not in NOT_IN_DEBIAN | GUARDED[package]}


@needs_standard
@pytest.mark.parametrize("package", sorted(CONTENTS))
def test_what_a_function_imports_is_at_least_suggested(package, substituted):
    known = names_in(package, ["Depends", "Recommends", "Suggests"], substituted)
    missing = {root: str(path) for root, path in roots(package, lambda tree: tree).items()
               if debian_name(root) not in known and root not in NOT_IN_DEBIAN}
    assert not missing


def test_every_variable_and_every_key_of_package_xml_is_known(substituted):
    used = set(re.findall(r"\$\{(ros:\w+)\}", (DEBIAN / "control").read_text(encoding="utf-8")))
    assert used == set(substituted) and "python3-rospy" in substituted["ros:Depends"]


def test_the_vendored_wheels_are_pinned_by_hash():
    lines = [line for line in (DEBIAN / "vendor.txt").read_text(encoding="utf-8").splitlines() if line[0] != "#"]
    names = [re.match(r"([\w-]+)==[\d.]+ --hash=sha256:[0-9a-f]{64}$", line).group(1) for line in lines]
    assert names == ["mcap", "rosbags"]


UNITS = {"jaka-driver@arm.service": "python3-jaka-ros-driver.jaka-driver@.service",
         "jaka-black-box@arm.service": "python3-jaka-ros-driver.jaka-black-box@.service",
         "jaka-panel.service": "jaka-panel.service"}
"""The services, as they are started, and their files."""


SIZES = {"SystemMaxUse", "SystemMaxFileSize", "SystemKeepFree"}


def journal_settings(text):
    """Return the settings of a file for journald, sizes in bytes; raise where journald would leave one out."""
    parser = configparser.ConfigParser(interpolation=None)
    parser.optionxform = str
    parser.read_string(text)
    assert parser.sections() == ["Journal"]
    found = dict(parser["Journal"])
    for name in SIZES & set(found):
        size, = re.findall(r"^(\d+)([KMGT])$", found[name])
        found[name] = int(size[0]) << 10 * (1 + "KMGT".index(size[1]))
    return found


def test_the_journal_has_a_bound_that_is_installed_and_that_the_page_shows():
    text = (DEBIAN / "journald.conf").read_text(encoding="utf-8")
    assert "debian/journald.conf " in (DEBIAN / "python3-jaka-ros-driver.install").read_text(encoding="utf-8")
    found = journal_settings(text)
    assert set(found) == SIZES | {"Storage"} and found["Storage"] == "persistent", "a crash is looked into afterwards"
    assert found["SystemMaxFileSize"] * 8 <= found["SystemMaxUse"] <= 4 << 30, "files are removed as a whole"
    page = (ROOT / "docs" / "operation.md").read_text(encoding="utf-8")
    shown, = re.findall(r"```ini\n(.*?)```", page, re.DOTALL)
    assert shown == "".join(line for line in text.splitlines(True) if not line.startswith("#"))


@pytest.mark.parametrize("line", ["SystemMaxUse=1 GB", "SystemMaxUse=lots", "MaxUse"])
def test_a_size_that_journald_would_leave_out_is_noticed(line):
    with pytest.raises((AssertionError, ValueError, configparser.Error)):
        journal_settings("[Journal]\n%s\n" % line)


def test_the_log_files_are_rotated_as_the_page_says():
    rotation = pathlib.Path("/etc/ros/python_logging.conf")
    if not rotation.exists():
        pytest.skip("needs Debian's rospy")
    size, kept = re.search(r"'a', (\d+), (\d+)\)", rotation.read_text(encoding="utf-8")).groups()
    page = (ROOT / "docs" / "operation.md").read_text(encoding="utf-8")
    assert (int(size), int(kept)) == (50_000_000, 4) and "five files of 50 MB" in page


@pytest.fixture(scope="module")
def unit():
    return DEBIAN / UNITS["jaka-driver@arm.service"]


def test_every_service_is_installed_and_none_is_enabled_or_started():
    assert {path.name for path in DEBIAN.glob("*.service")} - {"roscore.service"} == set(UNITS.values())  # an example
    lines = re.findall(r"^\tdh_installsystemd (.*)$", (DEBIAN / "rules").read_text(encoding="utf-8"), re.MULTILINE)
    assert len(lines) == len(UNITS) and all("--no-enable --no-start" in line for line in lines)
    named = [re.search(r"--package=(\S+).*?(?:--name=(\S+))?$", line).groups("") for line in lines]
    assert {".".join(filter(None, [*words, "service"])) for words in named} == set(UNITS.values())


@pytest.mark.parametrize("name", UNITS)
def test_a_service_is_started_again_within_limits_and_not_where_that_is_in_vain(name):
    lines = (DEBIAN / UNITS[name]).read_text(encoding="utf-8").splitlines()
    assert {"Restart=on-failure", "RestartSec=5", "StartLimitIntervalSec=600", "StartLimitBurst=20",
            "RestartPreventExitStatus=2"} <= set(lines)


def test_the_panels_token_stays_out_of_the_journal():
    lines = (DEBIAN / UNITS["jaka-panel.service"]).read_text(encoding="utf-8").splitlines()
    assert "StandardOutput=null" in lines and "StateDirectoryMode=0700" in lines
    start, = (line for line in lines if line.startswith("ExecStart="))
    assert "--token-file /var/lib/jaka-panel/token" in start


def test_the_driver_is_watched_from_when_it_runs_and_may_wait_for_its_master(unit):
    lines = unit.read_text(encoding="utf-8").splitlines()
    assert {"Type=notify", "NotifyAccess=main", "WatchdogSec=10", "TimeoutStartSec=infinity"} <= set(lines)


def test_the_service_powers_no_arm_and_leaves_the_guard_alone(unit):
    lines = unit.read_text(encoding="utf-8").splitlines()
    start, = (line for line in lines if line.startswith("ExecStart="))
    assert start.split()[-1] == "_auto_enable:=false"  # the last value of a parameter is the one that counts
    assert "KillMode=process" in lines


@pytest.mark.parametrize("given", [{}, {"IP": "10.5.5.100"}, {"IP": "10.5.5.100", "MODEL": ""},
                                   {"IP": "10.5.5.100", "MODEL": "zu7"}])
def test_the_service_starts_no_driver_without_address_and_model(unit, given):
    script, = re.findall(r"^ExecStartPre=/bin/sh -c '(.*)'$", unit.read_text(encoding="utf-8"), re.MULTILINE)
    script = script.replace("$$", "$").replace("%i", "left")
    done = subprocess.run(["sh", "-c", script], env={"PATH": "/usr/bin:/bin", **given},
                          stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    is_complete = all(given.get(name) for name in ("IP", "MODEL"))
    assert (done.returncode == 0) is is_complete and ("/etc/jaka/left.conf" in done.stdout) is not is_complete


@pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="needs systemd-analyze")
@pytest.mark.parametrize("name", UNITS)
def test_systemd_finds_no_mistake_in_a_service_and_few_rights(name, tmp_path):
    copy = tmp_path / name
    text = (DEBIAN / UNITS[name]).read_text(encoding="utf-8")
    copy.write_text(re.sub(r"/usr/bin/jaka_\w+", "/bin/true", text), encoding="utf-8")  # it need not be installed
    verified = subprocess.run(["systemd-analyze", "verify", "--man=no", str(copy)], stdout=subprocess.PIPE,
                              stderr=subprocess.STDOUT, text=True)
    assert verified.returncode == 0 and "jaka" not in verified.stdout, verified.stdout
    done = subprocess.run(["systemd-analyze", "security", "--offline=true", "--no-pager", "--threshold=15", str(copy)],
                          stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    assert done.returncode == 0 and "Overall exposure level" in done.stdout, done.stdout


@pytest.mark.parametrize("script", ["build", "packaging"])
def test_trees_below_the_checkout_are_hidden_from_roslaunch(script):
    # It looks for a launch file in every folder of the package that is not hidden, and starts none of two.
    folder, = re.findall(r"^TREE=(\S+)", (DEBIAN.parent / script).read_text(encoding="utf-8"), re.MULTILINE)
    assert any(part.startswith(".") for part in folder.split("/"))


def test_a_purge_leaves_the_audit_logs_and_nothing_else(tmp_path):
    kept, state = tmp_path / "var/lib/private/jaka-driver", tmp_path / "var/lib/jaka-driver"
    for file in ("left/jaka_audit/10.5.5.100_10001/audit-1.jsonl", "left/other/file", "right/file"):
        (kept / file).parent.mkdir(parents=True, exist_ok=True)
        (kept / file).write_text("evidence\n", encoding="utf-8")
    state.mkdir()
    for arm in ("left", "right"):
        (state / arm).symlink_to(os.path.join("..", "private", "jaka-driver", arm))
    (tmp_path / "var/log/jaka-driver").mkdir(parents=True)
    script = (DEBIAN / "python3-jaka-ros-driver.postrm").read_text(encoding="utf-8")
    script = script.replace(" /var/", " %s/var/" % tmp_path)
    subprocess.run(["sh", "-c", script, "postrm", "purge"], check=True, timeout=30)
    assert [str(path.relative_to(kept)) for path in kept.rglob("*") if path.is_file()] == [
        "left/jaka_audit/10.5.5.100_10001/audit-1.jsonl"]
    assert [path.name for path in state.iterdir()] == ["left"] and not (tmp_path / "var/log/jaka-driver").exists()
