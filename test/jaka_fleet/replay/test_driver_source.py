"""The driver that is judged: of a folder or a version, packed for workers; golden logs and their names."""
import io
import shutil
import subprocess
import sys
import tarfile

import pytest
from import_graph import ROOT

from jaka_bag.cli.main import main
from jaka_bag.errors import BagError, UsageError
from jaka_fleet.cli.replay import goldens_of
from jaka_fleet.replay import driver_source as module
from jaka_fleet.replay.driver_source import DriverSource, driver_source, unpack
from jaka_regression.command_lines import DRIVER, driver_in

GOLDEN = ROOT / "test" / "data" / "golden"


def names_in(source):
    with tarfile.open(fileobj=io.BytesIO(source.archive)) as archive:
        return set(archive.getnames())


@pytest.fixture
def checkout(tmp_path):
    """Write a small driver with messages, as a checkout with a build has them."""
    node = tmp_path / "checkout" / "jaka_ros_driver" / "ros" / "node.py"
    node.parent.mkdir(parents=True)
    node.write_text("def main():\n    print('another driver')\n    return 3\n")
    (node.parents[1] / "__init__.py").write_text("")
    (node.parents[1] / "py.typed").write_text("")
    messages = tmp_path / "checkout" / "devel" / "lib" / "python3" / "dist-packages" / "jaka_msgs"
    (messages / "msg").mkdir(parents=True)
    (messages / "__init__.py").write_text("")
    return tmp_path / "checkout"


def test_a_checkout_is_packed_with_its_messages_and_the_same_each_time(checkout, tmp_path):
    source = driver_source(str(checkout))
    assert source.has_messages and source.name == str(checkout)
    assert names_in(source) == {"jaka_ros_driver/__init__.py", "jaka_ros_driver/ros/node.py", "jaka_msgs/__init__.py"}
    assert driver_source(str(checkout)) == source
    place = tmp_path / "installed" / "lib" / "python3" / "dist-packages"
    shutil.copytree(str(checkout / "jaka_ros_driver"), str(place / "jaka_ros_driver"))
    installed = driver_source(str(tmp_path / "installed"))
    assert not installed.has_messages and "jaka_ros_driver/ros/node.py" in names_in(installed)


def test_the_unpacked_driver_is_the_one_that_starts(checkout, tmp_path):
    folder = unpack(driver_source(str(checkout)), tmp_path / "driver")
    done = subprocess.run([sys.executable, *driver_in(str(folder))], stdout=subprocess.PIPE, check=False)
    assert done.returncode == 3 and done.stdout == b"another driver\n"
    assert unpack(driver_source(None), tmp_path / "none") is None and DRIVER[1] in driver_in("x")[1]


@pytest.mark.skipif(not (ROOT / ".git").exists(), reason="this is no git checkout")
def test_a_version_is_a_commit_of_the_checkout():
    source = driver_source("HEAD")
    assert source.name.startswith("version HEAD (") and not source.has_messages
    assert "jaka_ros_driver/ros/node.py" in names_in(source)
    assert not any(name.startswith("tools") for name in names_in(source))


def test_an_installed_package_takes_no_version_from_another_checkout(tmp_path, monkeypatch):
    place = tmp_path / "install" / "lib" / "python3" / "dist-packages" / "jaka_regression" / "many" / "driver_source.py"
    for words in ("init -q", "-c user.name=a -c user.email=a@b commit -q --allow-empty -m x", "tag v1.0"):
        subprocess.run(["git", *words.split()], cwd=str(tmp_path), check=True)
    place.parent.mkdir(parents=True)
    monkeypatch.setattr(module, "__file__", str(place))
    with pytest.raises(UsageError, match="1.0 is no folder; versions are those of a git checkout of the driver"):
        driver_source("1.0")


@pytest.mark.parametrize("wanted, words", [
    ("9.9.9", "no folder, and no version"), ("-x", "no folder and no version"), ("{empty}", "holds no driver")])
def test_what_is_no_driver_is_a_usage_error(wanted, words, tmp_path, capsys):
    with pytest.raises(UsageError, match=words):
        driver_source(wanted.format(empty=tmp_path))
    golden = str(GOLDEN / "boot.mcap")
    assert main(["replay", golden, "--against-driver=" + wanted.format(empty=tmp_path), "-o", str(tmp_path / "o")]) == 2
    assert words in capsys.readouterr().err


def test_an_archive_that_leads_elsewhere_is_refused(tmp_path):
    buffer = io.BytesIO()
    with tarfile.open(fileobj=buffer, mode="w:bz2") as archive:
        archive.addfile(tarfile.TarInfo("../outside.py"), io.BytesIO())
    with pytest.raises(BagError, match="outside.py"):
        unpack(DriverSource("x", buffer.getvalue()), tmp_path / "driver")


def test_golden_logs_of_the_same_name_get_folders_of_their_own(tmp_path):
    for name in ("a/run.mcap", "b/run.mcap", "b/run.bag", "b/other.mcap"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_bytes(b"")
    found = goldens_of([str(tmp_path / "a"), str(tmp_path / "b")])
    assert sorted(path.relative_to(tmp_path).as_posix() for path in found.values()) == [
        "a/run.mcap", "b/other.mcap", "b/run.bag", "b/run.mcap"]
    assert {"run", "b_run", "other"} < set(found) and len(found) == 4
    for words in ([str(tmp_path / "c")], [str(tmp_path / "a" / "run.mcap"), "nothing.mcap"]):
        with pytest.raises(BagError, match="there is no"):
            goldens_of(words)
