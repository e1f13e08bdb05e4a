"""The rules of the house that a machine can keep: who imports whom, sizes, names, Python 3.8."""
import ast
import importlib.util
import itertools
import re
from functools import lru_cache
from pathlib import Path
from typing import Dict, Iterator, List, Set

import pytest
from import_graph import PACKAGES, ROOT, dotted, imported_names, modules, named_modules, parse, source_of


def rooms(package: str, allowed: Dict[str, Set[str]]) -> Dict[str, Set[str]]:
    """Return the same table with absolute names; those of other packages have them already."""
    def absolute(name: str) -> str:
        return name if name.split(".")[0] in PACKAGES else ".".join(filter(None, [package, name]))
    return {absolute(room): set(map(absolute, others)) for room, others in allowed.items()}


GROUND = {"background_log", "errors", "scheduling", "units", "yaml_text"}
DOMAIN = GROUND | {"state", "commands"}
SIMULATION = {"simulation.arm", "simulation.dialect", "simulation.controller", "simulation.server"}
FLOOR = {"allocator", "errors", "units", "interrupts", "driver_interface", "json_text", "log_records", "paths",
         "output_file", "pipeline", "yaml_text"}
CONTAINERS = {"containers", "containers.registry"}
TOOLS = FLOOR | CONTAINERS | {
    "messages", "operations", "live", "compare.tolerances", "compare.runs", "compare.matching", "compare.verdict",
    "compare.checks", "compare", "compare.audit", "compare.report", "engines"}
COMMAND_LINES = {"cli", "cli.main"}
ALL_OF_JAKA_BAG = {"jaka_bag"} | {"jaka_bag." + room for room in TOOLS | COMMAND_LINES}
"""Everything that packages on the log tools may import; none of them knows the others."""
FORMATS = {"containers.bag", "containers.mcap"}
ROOMS: Dict[str, Set[str]] = {  # what each room may import besides itself; a module is in the room of the longest name
    **rooms("jaka_ros_driver", {
        "": set(),
        "errors": set(),
        "units": set(),
        "background_log": set(),
        "scheduling": set(),
        "yaml_text": {"errors"},
        "state": GROUND,
        "commands": GROUND | {"state"},
        "kinematics": DOMAIN,
        "protocol": DOMAIN,
        "trajectory": DOMAIN | {"kinematics"},
        "clearance": DOMAIN | {"kinematics"},
        "client": DOMAIN | {"clearance", "kinematics", "protocol", "trajectory"},
        "wire": DOMAIN | {"protocol"},
        "audit": set(),
        "simulation": DOMAIN | SIMULATION | {"kinematics", "protocol", "wire"},
        "simulation.arm": DOMAIN | {"kinematics"},
        "simulation.dialect": {"errors", "yaml_text"},
        "simulation.controller": DOMAIN | {"kinematics", "protocol", "simulation.arm", "simulation.dialect"},
        "simulation.server": DOMAIN | {"kinematics", "protocol", "wire", "simulation.arm", "simulation.dialect",
                                       "simulation.controller"},
        "ros": DOMAIN | {"clearance", "kinematics", "protocol", "trajectory", "client", "audit"},
        "doctor": DOMAIN | {"", "kinematics", "protocol", "client", "ros"},
        "probe": DOMAIN | {"", "kinematics", "protocol", "client", "wire", "simulation.arm", "simulation.dialect",
                           "ros"},
    }),
    **rooms("jaka_bag", {
        "": CONTAINERS | {"operations"},  # the names it lends to other code
        "errors": set(),
        "units": set(),
        "driver_interface": set(),
        "json_text": set(),
        "log_records": set(),
        "yaml_text": set(),
        "interrupts": set(),
        "paths": set(),
        "output_file": {"errors", "interrupts", "paths"},
        "pipeline": set(),
        "allocator": set(),
        "messages": FLOOR,
        "containers": FLOOR | {"messages"},
        "containers.bag": FLOOR | {"messages", "containers"},
        "containers.mcap": FLOOR | {"messages", "containers"},
        "containers.rosbag2": FLOOR | {"messages", "containers", "containers.mcap"},
        "containers.rosbag2_folder": FLOOR | {"messages", "containers"},
        "containers.rosbag2_reader": FLOOR | {"messages", "containers", "containers.rosbag2_folder"},
        "containers.rosbag2_recovery": FLOOR | {"messages", "containers", "containers.mcap"},
        "containers.registry": FLOOR | {"containers", "containers.rosbag2", "containers.rosbag2_reader",
                                        "containers.rosbag2_recovery"} | FORMATS,
        "operations": FLOOR | CONTAINERS | {"messages"},
        "live": FLOOR | CONTAINERS | {"messages"},
        "engines": FLOOR | {"", "operations"},
        "compare.tolerances": FLOOR,
        "compare.runs": FLOOR | CONTAINERS | {"messages", "operations", "compare.tolerances"},
        "compare.matching": FLOOR | {"messages", "compare.tolerances", "compare.runs"},
        "compare.verdict": FLOOR | {"messages", "compare.tolerances", "compare.runs", "compare.matching"},
        "compare.checks": FLOOR | {"messages", "operations", "compare.tolerances", "compare.runs", "compare.matching",
                                   "compare.verdict"},
        "compare": FLOOR | {"messages", "compare.tolerances", "compare.runs", "compare.matching", "compare.verdict",
                            "compare.checks"},
        "compare.audit": FLOOR | CONTAINERS | {"messages", "operations", "compare.tolerances", "compare.runs",
                                               "compare.matching", "compare"},
        "compare.report": FLOOR | {"messages", "operations", "compare.tolerances", "compare.runs", "compare.matching",
                                   "compare.verdict", "compare.checks", "compare.audit"},
        "cli": TOOLS | {"cli.main", "containers.rosbag2_folder"},
        "cli.main": {"", "cli", "jaka_blackbox.cli", "jaka_foxglove.cli", "jaka_fleet.cli", "jaka_regression"} | FLOOR,
        "__main__": {"cli.main"},
    }),
    **rooms("jaka_blackbox", {
        "": ALL_OF_JAKA_BAG,
        "incident": {""} | ALL_OF_JAKA_BAG,
        "cli": {"", "incident"} | ALL_OF_JAKA_BAG,
    }),
    **rooms("jaka_foxglove", {
        "": ALL_OF_JAKA_BAG,
        "cli": {""} | ALL_OF_JAKA_BAG,
    }),
    **rooms("jaka_fleet", {
        "": set(),
        "dataset": ALL_OF_JAKA_BAG,
        "comparing": {"dataset"} | ALL_OF_JAKA_BAG,
        "replay": {"jaka_regression", "jaka_regression.command_lines"} | ALL_OF_JAKA_BAG,
        "cli": {"dataset", "comparing", "replay", "jaka_regression"} | ALL_OF_JAKA_BAG,
    }),
    **rooms("jaka_migration", {
        "": {"jaka_ros_driver." + room for room in DOMAIN | {"kinematics"}},
    }),
    **rooms("jaka_panel", {
        "": {"settings"},
        "settings": set(),
        "authority": set(),
        "record": set(),
        "plans": {"teach", "jaka_regression"} | {"jaka_bag." + room for room in TOOLS},
        "graph": {"authority", "record", "teach", "plans", "jaka_regression", "jaka_regression.command_lines"} | {
            "jaka_bag." + room for room in TOOLS},
        "cell": {"jaka_ros_driver.audit", "jaka_bag.json_text"},
        "teach": set(),
        "pages": {"", "settings", "authority", "record", "cell", "teach", "plans", "graph", "jaka_bag.json_text"},
        "command": {"", "settings", "graph", "pages", "jaka_regression"},
    }),
    **rooms("jaka_regression", {
        "": {"command_lines"} | {"jaka_bag." + room for room in TOOLS | {"cli"}},
        "command_lines": {"", "jaka_bag.cli.main", "jaka_ros_driver.ros", "jaka_ros_driver.simulation",
                     "jaka_ros_driver.simulation.server", "jaka_ros_driver.wire"},
    }),
}
NAME_MODULES_IN_STRINGS = {"jaka_bag", "jaka_bag.cli.main", "jaka_bag.containers.registry",
                           "jaka_panel.plans.plan_store", "jaka_regression.command_lines"}
"""Modules that import others by name, or start them as commands; all those names must lead somewhere."""
OPEN_SOCKETS = tuple("jaka_ros_driver." + name for name in (
    "client.supervisor", "client.transport", "doctor.controller", "doctor.graph", "doctor.questions", "ros.connections",
    "probe.recorded", "ros.driver_lock", "ros.metrics.page_server", "ros.services.connection", "ros.start_checks",
    "simulation.server.event_loop", "wire")) + (
        "jaka_bag.live.tcpros", "jaka_bag.live.publisher", "jaka_blackbox.service", "jaka_foxglove.server",
        "jaka_panel.pages.door", "jaka_panel.pages.server", "jaka_panel.settings", "jaka_panel.graph.stop_link")
USE_ROS = ("jaka_ros_driver.ros", "jaka_panel.graph", "jaka_panel.command", "jaka_regression.driver_client",
           "jaka_regression.ros_node", "jaka_regression.cell.live_watch", "jaka_regression.message_player",
           "jaka_regression.trajectory_client")
ASYNC = ("jaka_foxglove", "jaka_panel.pages", "jaka_panel.command", "jaka_panel.graph.calls",
         "jaka_panel.graph.stopper")
LONGEST = 600
"""Lines of a file: an alarm, not a goal; more than that nobody reads in one sitting."""
LARGEST = 25
"""Modules in a folder: an alarm, not a goal; above it ask which rooms these really are. ``jaka_bag.cli`` has 23, for it
has a file for each subcommand, and a reader looks for it there.
"""
WRITTEN = {"", ".in", ".launch", ".md", ".msg", ".py", ".rst", ".sh", ".srv", ".toml", ".txt", ".xml", ".yaml"}


def is_in(name: str, room: str) -> bool:
    return name == room or name.startswith(room + ".")


def room_of(name: str) -> str:
    return max((room for room in ROOMS if is_in(name, room)), key=len)


def module_of(name: str) -> str:
    """Return the module of this project that holds a dotted name; empty for another's."""
    parts = name.split(".")
    while parts and ".".join(parts) not in modules():
        parts.pop()
    return ".".join(parts)


@lru_cache(maxsize=None)
def imports_of(name: str) -> Set[str]:
    path = modules()[name]
    return set(imported_names(parse(path), path.parent))


def project_imports(name: str) -> Set[str]:
    """Return modules of this project that a module imports in any way."""
    return {module_of(other) for other in imports_of(name) if other.split(".")[0] in PACKAGES} - {name}


def sources(*folders: Path) -> List[Path]:
    return sorted(path for folder in folders for path in folder.rglob("*.py"))


def written_texts() -> Iterator[Path]:
    """Return every text file of the checkout that people write."""
    tops = [path for path in ROOT.iterdir() if path.name not in ("build", "devel", "install")]  # large, and may change
    for path in sorted(itertools.chain(tops, *(top.rglob("*") for top in tops))):
        parts = path.relative_to(ROOT).parts
        hidden = any(part.startswith(".") and part != ".ci" for part in parts)
        generated = any(part.endswith(".egg-info") for part in parts)
        if path.is_file() and not hidden and not generated and path.suffix in WRITTEN:
            yield path


def test_rooms_import_only_from_the_rooms_below():
    wrong = []
    for name, path in modules().items():
        others = project_imports(name)
        if name in NAME_MODULES_IN_STRINGS:
            others |= set(map(module_of, named_modules(parse(path))))
        allowed = ROOMS[room_of(name)] | {room_of(name)}
        wrong += ["%s imports %s" % (name, other) for other in others if room_of(other) not in allowed]
    assert not wrong, "\n".join(wrong)


def test_packages_that_need_another_than_the_ground_do_so_for_a_reason_on_the_page():
    page = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
    _, _, rest = page.partition("<!-- needs another -->\n")
    told = re.findall(r"^- `(\w+)` needs `(\w+)`: \w", rest.partition("<!-- end -->")[0], re.MULTILINE)
    tops = {(name.split(".")[0], other.split(".")[0]) for name in modules() for other in project_imports(name)}
    needs = {(one, other) for one, other in tops if other not in (one, "jaka_bag")}
    assert sorted(told) == sorted(needs)


def test_every_room_is_there():
    missing = [room for room in ROOMS if room not in modules()]
    assert not missing, missing


def test_modules_named_in_strings_are_named_in_few_places_and_are_there():
    for name, path in modules().items():
        named = named_modules(parse(path))
        if name in NAME_MODULES_IN_STRINGS:
            assert named and named <= set(modules()), "%s names %s" % (name, named - set(modules()))
        elif name != "jaka_bag.compare.report.junit":  # names its test suite
            assert not named & set(modules()), "%s names %s" % (name, named & set(modules()))


def test_commands_and_plugins_are_there():
    def entries(*path: str) -> List[str]:
        return re.findall(r"\w=\"?((?:%s)[\w.]*:\w+|(?:%s)[\w.]+)" % (("|".join(PACKAGES),) * 2),
                          ROOT.joinpath(*path).read_text().replace(" = ", "="))
    commands = entries("CMakeLists.txt")
    scripts = [entry for path in (("tools",), ("tools", "probe")) for entry in entries(*path, "pyproject.toml")
               if ":" in entry]
    assert len(commands) == 10 and len(scripts) == 4
    for entry in commands + scripts + entries("setup.cfg"):
        module, _, function = entry.partition(":")
        names = {node.name for node in parse(source_of(module)).body if isinstance(node, ast.FunctionDef)}
        assert not function or function in names, entry


@pytest.mark.parametrize("packages, allowed", [
    ({"socket"}, lambda name: any(is_in(name, room) for room in OPEN_SOCKETS)),
    ({"rospy", "jaka_msgs"}, lambda name: any(is_in(name, room) for room in USE_ROS)),
    ({"asyncio", "aiohttp"}, lambda name: any(is_in(name, room) for room in ASYNC)),
    ({"threading", "time", "select", "queue", "socket"}, lambda name: not is_in(name, "jaka_panel.authority")),
    ({"threading", "time", "select", "queue", "random"}, lambda name: not is_in(name, "jaka_ros_driver.client.core")),
])
def test_outside_packages_stay_in_their_rooms(packages, allowed):
    wrong = [name for name in modules()
             if {other.split(".")[0] for other in imports_of(name)} & packages and not allowed(name)]
    assert not wrong, "%s in %s" % (packages, wrong)


@pytest.mark.parametrize("package, names", [("socket", OPEN_SOCKETS), ("rospy", USE_ROS), ("asyncio", ASYNC)])
def test_no_exception_is_stale(package, names):
    stale = [name for name in names if not any(
        other.split(".")[0] == package for module in modules() if is_in(module, name) for other in imports_of(module))]
    assert not stale, stale


def test_files_are_python_3_8_of_bounded_length_under_a_telling_name():
    wrong = []
    for path in sources(*PACKAGES.values(), ROOT / "test"):
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


def test_folders_are_small():
    counts: Dict[str, int] = {}
    for path in sources(*PACKAGES.values(), ROOT / "test"):
        folder = path.parent.relative_to(ROOT).as_posix()
        counts[folder] = counts.get(folder, 0) + 1
    large = {folder: count for folder, count in counts.items() if count > LARGEST}
    assert not large, large


def test_each_package_lists_its_shelf_truthfully():
    wrong = []
    for path in sources(*PACKAGES.values()):
        folder = path.parent
        if path.name != "__init__.py":
            continue
        lines = re.findall(r"^([a-z_0-9]+(?:, [a-z_0-9]+)*)  +\S", ast.get_docstring(parse(path)) or "", re.MULTILINE)
        listed = [name for line in lines for name in line.split(", ")]
        there = {entry.stem for entry in folder.iterdir() if entry.suffix == ".py" and entry != path}
        there |= {entry.parent.name for entry in folder.glob("*/__init__.py")}
        if sorted(listed) != sorted(there):
            wrong.append("%s: %s" % (dotted(path), sorted(set(listed) ^ there) or "names one twice"))
    assert not wrong, "\n".join(wrong)


def test_no_text_names_a_machine_path():
    machine_path = re.compile(r"(?<![\w.~$}/-])/(?:work|root|home|Users)/\w")
    wrong = ["%s:%d: %s" % (path.relative_to(ROOT), number, line.strip())
             for path in written_texts()
             for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1)
             if machine_path.search(line)]
    assert not wrong, "\n".join(wrong)


def test_imports_in_functions_and_relative_ones_are_seen():
    tree = ast.parse("from . import tcpros\nfrom ..errors import BagError\n"
                     "def f():\n    import socket, rospy.names\n")
    assert set(imported_names(tree, PACKAGES["jaka_bag"] / "live")) == {
        "jaka_bag.live.tcpros", "jaka_bag.errors.BagError", "socket", "rospy.names"}
    assert named_modules(ast.parse("run('jaka_bag.live.tcpros', 'jaka_bag.cli.main:main', 'see jaka_bag.cli')")) == {
        "jaka_bag.live.tcpros", "jaka_bag.cli.main"}


def test_no_module_imports_itself_in_a_circle():
    needs = {name: project_imports(name) for name in modules()}
    while True:
        free = {name for name, others in needs.items() if not others & set(needs)}
        if not free:
            break
        needs = {name: others for name, others in needs.items() if name not in free}
    assert not needs, "in circles: %s" % ", ".join(sorted(needs))


def test_the_version_is_that_of_the_ros_package():
    package = re.search(r"<version>(.+?)</version>", (ROOT / "package.xml").read_text())
    for name in ("jaka_ros_driver", "jaka_bag"):
        spec = importlib.util.spec_from_file_location(name, str(PACKAGES[name] / "__init__.py"))
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
        assert module.__version__ == package.group(1)
