"""The rules of the house that a machine can keep: who imports whom, sizes, names, Python 3.8."""
import ast
import re
from pathlib import Path
from typing import Dict, Iterator, List, Set

import pytest
from import_graph import ROOT, imported_names, parse

PACKAGE = ROOT / "jaka_ros_driver"
GROUND = {"background_log", "errors", "units"}
DOMAIN = GROUND | {"state", "commands"}
ROOMS: Dict[str, Set[str]] = {  # what each room may import from the package besides itself
    "__init__": set(),
    "errors": set(),
    "units": set(),
    "background_log": set(),
    "voice": {"background_log"},
    "state": GROUND,
    "commands": GROUND | {"state"},
    "kinematics": DOMAIN,
    "protocol": DOMAIN,
    "client": DOMAIN | {"kinematics", "protocol"},
    "wire": DOMAIN | {"protocol"},
    "simulation": DOMAIN | {"kinematics", "protocol", "wire"},
    "ros": DOMAIN | {"kinematics", "protocol", "client"},
    "bags": GROUND | {"state", "voice"},
}
INNER_ROOMS: Dict[str, Set[str]] = {  # what each room inside simulation may import from simulation besides itself
    "__init__": set(),
    "arm": set(),
    "controller": {"arm"},
    "server": {"arm", "controller"},
    "simulated_controller": {"arm", "controller", "server"},
    "__main__": {"controller", "server", "simulated_controller"},
}
LOWEST_INNER_ROOMS = {"arm": DOMAIN | {"kinematics"}, "controller": DOMAIN | {"kinematics", "protocol"}}
"""What these rooms inside simulation may import from outside it: less than simulation as a whole."""
OPEN_SOCKETS = ("client/transport", "client/stop_link", "ros/connections", "ros/driver_lock",
                "simulation/server/server", "wire/", "bags/raw_transport", "bags/tcpros")
ROS_OUTSIDE_ITS_ROOM = {"bags/rospy_transport.py", "bags/player.py", "bags/regression/driver_client.py"}
LONGEST = 600
MOST_FILES = 20
WRITTEN = {"", ".launch", ".md", ".msg", ".py", ".rst", ".sh", ".srv", ".toml", ".txt", ".xml", ".yaml"}


def modules(*folders: Path) -> List[Path]:
    return sorted(path for folder in folders for path in folder.rglob("*.py"))


def room_of(path: Path) -> str:
    return path.relative_to(PACKAGE).with_suffix("").parts[0]


def imports_of(path: Path) -> Set[str]:
    return set(imported_names(parse(path), path.parent))


def written_texts() -> Iterator[Path]:
    """Every text file of the checkout that people write."""
    for path in sorted(ROOT.rglob("*")):
        parts = path.relative_to(ROOT).parts
        hidden = any(part.startswith(".") and part != ".ci" for part in parts)
        generated = parts[0] in ("build", "devel", "install")
        if path.is_file() and not hidden and not generated and path.suffix in WRITTEN:
            yield path


def test_rooms_import_only_from_the_rooms_below():
    wrong = []
    for path in modules(PACKAGE):
        room = room_of(path)
        wrong += ["%s imports %s" % (path.relative_to(ROOT), name) for name in imports_of(path)
                  if name.startswith("jaka_ros_driver.") and name.split(".")[1] not in ROOMS[room] | {room}]
    assert not wrong, "\n".join(wrong)


def test_rooms_inside_the_simulation_import_only_from_those_below():
    wrong, simulation = [], PACKAGE / "simulation"
    for path in modules(simulation):
        room = path.relative_to(simulation).with_suffix("").parts[0]
        for name in imports_of(path):
            parts = name.split(".") + [""]
            if parts[:2] == ["jaka_ros_driver", "simulation"]:
                is_right = not parts[2] or parts[2] in INNER_ROOMS[room] | {room}
            else:
                is_right = (parts[0] != "jaka_ros_driver" or room not in LOWEST_INNER_ROOMS
                            or parts[1] in LOWEST_INNER_ROOMS[room])
            if not is_right:
                wrong.append("%s imports %s" % (path.relative_to(ROOT), name))
    assert not wrong, "\n".join(wrong)


def test_no_folder_of_the_driver_is_crowded():
    crowded = ["%s: %d files" % (folder.relative_to(ROOT), len(list(folder.glob("*.py"))))
               for folder in sorted({path.parent for path in modules(PACKAGE)})
               if room_of(folder / "x.py") != "bags" and len(list(folder.glob("*.py"))) > MOST_FILES]
    assert not crowded, "\n".join(crowded)


@pytest.mark.parametrize("packages, allowed", [
    ({"socket"}, lambda where: where.startswith(OPEN_SOCKETS)),
    ({"rospy", "jaka_msgs"}, lambda where: where.startswith("ros/") or where in ROS_OUTSIDE_ITS_ROOM),
    ({"asyncio"}, lambda where: False),
    ({"threading", "time", "select", "queue", "random"}, lambda where: not where.startswith("client/core/")),
])
def test_outside_packages_stay_in_their_rooms(packages, allowed):
    wrong = [where for where in (path.relative_to(PACKAGE).as_posix() for path in modules(PACKAGE))
             if {name.split(".")[0] for name in imports_of(PACKAGE / where)} & packages and not allowed(where)]
    assert not wrong, "%s in %s" % (packages, wrong)


def test_files_are_python_3_8_of_bounded_length_under_a_telling_name():
    wrong = []
    for path in modules(PACKAGE, ROOT / "test"):
        text = path.read_text(encoding="utf-8")
        try:
            ast.parse(text, feature_version=(3, 8))
        except SyntaxError as error:
            wrong.append("%s: %s" % (path, error))
        if text.count("\n") > LONGEST:
            wrong.append("%s: longer than %d lines" % (path, LONGEST))
        if path.stem in ("utils", "common", "helpers", "misc"):
            wrong.append("%s: says nothing about its content" % path)
    assert not wrong, "\n".join(wrong)


def test_no_text_names_a_machine_path():
    machine_path = re.compile(r"(?<![\w.~$}/-])/(?:work|root|home|Users)/\w")
    wrong = ["%s:%d: %s" % (path.relative_to(ROOT), number, line.strip())
             for path in written_texts()
             for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1)
             if machine_path.search(line)]
    assert not wrong, "\n".join(wrong)


def test_imports_in_functions_and_relative_ones_are_seen():
    tree = ast.parse("from . import tcpros\nfrom ..client.transport import Link\n"
                     "def f():\n    import socket, rospy.names\n")
    assert set(imported_names(tree, PACKAGE / "bags")) == {
        "jaka_ros_driver.bags.tcpros", "jaka_ros_driver.client.transport.Link", "socket", "rospy.names"}


def test_no_module_of_the_driver_imports_itself_in_a_circle():
    """``bags`` has circles of old; nothing else may."""
    names = {".".join(path.relative_to(ROOT).with_suffix("").parts): path for path in modules(PACKAGE)
             if room_of(path) != "bags"}
    needs = {}
    for name, path in names.items():
        imported = imports_of(path)
        needs[name] = {other for other in names if other != name and (
            other in imported or any(got.startswith(other + ".") for got in imported))}
    while True:
        free = {name for name, others in needs.items() if not others & set(needs)}
        if not free:
            break
        needs = {name: others for name, others in needs.items() if name not in free}
    assert not needs, "in circles: %s" % ", ".join(sorted(needs))
