"""The command lines that a reader is asked to type: each executable is there, and understands it; quick ones are
run."""
import functools
import importlib
import json
import os
import re
import shlex
import shutil
import subprocess
import sys
from xml.etree import ElementTree

import command_parsers
import command_places
import genpy
import pytest
import roslib.message
import yaml
from command_parsers import Wrong
from command_places import command_of
from import_graph import LOG_TOOLS, PACKAGES, ROOT, modules
from written_commands import Written, concrete, everything, of_head, of_page, parts

from jaka_bag.cli.main import main
from jaka_ros_driver.ros.services.table import SERVICES
from jaka_ros_driver.simulation.server.operator_actions import ACTIONS

FOREIGN = {"jaka_driver": "the maker's package", "jaka_planner": "the maker's package"}
"""Packages on the pages that are not ours, nor Debian's."""
SHELL_WORDS = {"echo", "cd", "diff", "ln", "mkdir", "mv", "rm", "sed", "touch", "true", "catkin_make"}
"""Shell commands that the page's own test runs, in its order."""
NAMES_IN_THE_NODE = "\n".join(path.read_text(encoding="utf-8")
                              for folder in (ROOT / "jaka_ros_driver" / "ros", *map(PACKAGES.get, LOG_TOOLS))
                              for path in folder.rglob("*.py"))
OF_ACTIONS = ("/goal", "/cancel", "/feedback", "/command")
FOUND = everything()


def environment():
    """Return the variables of a reader's shell that has sourced the place under test."""
    kept = {name: value for name, value in os.environ.items()
            if name in command_places.OF_A_SHELL or name.startswith("ROS_")}
    return dict(kept, PATH="/usr/bin:/bin", HOME="/tmp", LANG="C.UTF-8")


@functools.lru_cache(maxsize=None)
def shell(text):
    """Run a line that changes nothing as a reader does, at the top of the checkout; return its output."""
    done = subprocess.run(["bash", "-c", text], cwd=str(ROOT), env=environment(), stdin=subprocess.DEVNULL, text=True,
                          stdout=subprocess.PIPE, stderr=subprocess.STDOUT, timeout=200)
    return judged(done.stdout, done.returncode)


def judged(said, code):
    if code:
        raise Wrong("exit %d: %s" % (code, said[-1500:]))
    return said


RUNNERS = {}
"""The runners of scripts of ``parse_only.py``, by the beginning of a command line such as ``python3``."""


@pytest.fixture(scope="module", autouse=True)
def runners():
    """End the runners with the module."""
    yield
    for one in RUNNERS.values():
        one.communicate(timeout=60)
    RUNNERS.clear()


def run_until_understood(start, words):
    if start not in RUNNERS:
        RUNNERS[start] = subprocess.Popen(
            ["bash", "-c", "exec env %s test/support/pages/parse_only.py" % start], cwd=str(ROOT), env=environment(),
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    RUNNERS[start].stdin.write(json.dumps(words) + "\n")
    RUNNERS[start].stdin.flush()
    judged(*json.loads(RUNNERS[start].stdout.readline()))


def understand(program, words, is_whole):
    command_of(program)  # is there
    command_parsers.understand(program, words, is_whole)


# ---- of ROS ----

def launched(words, program):
    """Check a launch file of the place under test, and that it has these arguments."""
    words = [word for word in words if not word.startswith("--")]
    if words[0] in FOREIGN:
        return
    if words[0].endswith(".launch"):
        return  # the reader's own; the page's test makes it
    package, name, *arguments = words
    if package != "jaka_ros_driver":
        raise Wrong("no package %s" % package)
    path = shell("rospack find jaka_ros_driver").strip() + "/launch/" + name
    if not os.path.isfile(path):
        raise Wrong("no %s" % path)
    declared = {argument.get("name") for argument in ElementTree.parse(path).iter("arg")}
    unknown = {word.split(":=")[0] for word in arguments if word != "..."} - declared
    if unknown:
        raise Wrong("%s has no argument %s" % (name, unknown))
    if program == "roslaunch":
        shell("roslaunch --files jaka_ros_driver %s" % name)


def is_name_of_the_node(topic):
    last = topic.split("/", 2)[-1] if topic.startswith("/jaka_driver/") else topic.rsplit("/", 1)[-1]
    return any(re.search(r'"[~/]?%s"' % name, NAMES_IN_THE_NODE) for name in (last, last.split("/")[0], topic))


def service_called(words):
    verb, name, *texts = words
    if verb != "call":
        raise Wrong("rosservice %s" % verb)
    types = {"/jaka_driver/" + spec.name: spec.srv_type for spec in SERVICES}
    if name not in types:
        raise Wrong("no service %s" % name)
    filled(types[name]._request_class(), texts)


def topic_used(words):
    verb, *rest = words
    options = {"-n": 1, "-r": 1, "-f": 1, "-1": 0, "-l": 0}
    texts = []
    while rest:
        word = rest.pop(0)
        if word in options:
            del rest[:options[word]]
        elif word.startswith("-"):
            raise Wrong("rostopic %s has no %s" % (verb, word))
        else:
            texts.append(word)
    if verb not in ("echo", "hz", "pub", "type") or (texts and not texts[0].startswith("/")):
        raise Wrong("rostopic %s %s" % (verb, texts))
    if texts and not (is_name_of_the_node(texts[0]) or texts[0].endswith(OF_ACTIONS)):
        raise Wrong("no topic %s" % texts[0])
    if verb == "pub" and texts:
        kind = roslib.message.get_message_class(texts[1])
        if kind is None:
            raise Wrong("no type %s" % texts[1])
        filled(kind(), texts[2:])


def filled(message, texts):
    """Return the message of YAML texts, as rostopic and rosservice read them."""
    try:
        genpy.message.fill_message_args(message, [yaml.safe_load(text) for text in texts] or [{}],
                                        keys={"now": genpy.Time(1), "auto": {}})
    except (genpy.MessageException, yaml.YAMLError, ValueError) as error:
        raise Wrong("%s: %s" % (texts, error)) from None


# ---- Python, and the programs of contributors ----

def run_by_python(before, python, words, target):
    """Run a script until it has understood its words; a module of ours that prints a page is run whole."""
    if python == "python":
        raise Wrong("Debian has no python, but python3")
    if python == "build/venv/bin/python3" and not (ROOT / python).exists():
        python = sys.executable
    start = " ".join([*before, python])
    if words[0] != "-m":
        if not (ROOT / words[0]).is_file():
            raise Wrong("no file %s" % words[0])
        if words[0].startswith("test/fuzz/") and importlib.util.find_spec("atheris") is None:
            return "is there"  # by hand, with atheris
        run_until_understood(start, words)
        return "understood"
    module = words[1]
    if module.split(".")[0] in PACKAGES:
        if not target:
            source = modules().get(module)
            if source is None:
                raise Wrong("no module %s" % module)
            return "is there"
        if shell("%s -m %s" % (start, module)) != (ROOT / target).read_text(encoding="utf-8"):
            raise Wrong("%s is not what it prints" % target)
        return "run"
    missing = [word for word in words if word.startswith("test/") and not (ROOT / word).exists()]
    if missing:
        raise Wrong("no %s" % missing)
    if module == "pytest" and "-p" in words:
        importlib.import_module(words[words.index("-p") + 1])
    shell("%s -m %s --version" % (start, module))
    return "understood"


def dev(words):
    """Check a command of tools/dev: it is in its usage, with words that the started command understands."""
    usage = shell("tools/dev help")
    if not words:
        return
    name, *rest = words
    if not re.search(r"^ *(?:usage: )?tools/dev %s\b" % re.escape(name), usage, re.MULTILINE):
        raise Wrong("tools/dev has no %s" % name)
    scripts = {"simulate": "test/custody/simulate.py", "mutate": "test/mutation/mutate.py"}
    if name in scripts:
        run_by_python([], "build/venv/bin/python3", [scripts[name], *rest], "")
    elif name == "bench":
        for bench in rest:
            if not (ROOT / "test" / "benchmark" / ("bench_%s.py" % bench)).is_file():
                raise Wrong("no benchmark %s" % bench)
    elif name == "test":
        missing = [word for word in rest if "/" in word and not (ROOT / word).exists()]
        if missing:
            raise Wrong("no tests %s" % missing)
    elif name == "demo":
        launched(["jaka_ros_driver", "demo.launch", *rest], "rosrun")
    elif name == "setup" and rest:
        raise Wrong("setup takes no arguments")


def extras(words):
    """Check what pip is asked to install from this checkout."""
    declared = (ROOT / "tools" / "pyproject.toml").read_text(encoding="utf-8")
    for word in words:
        path, _, names = word.partition("[")
        if path.startswith("./"):
            missing = [name for name in names.rstrip("]").split(",") if name and not re.search(
                r"^%s = \[" % name, declared, re.MULTILINE)]
            if missing or not (ROOT / path / "pyproject.toml").is_file():
                raise Wrong("%s has no %s" % (path, missing))


def check(words, written, target=""):
    """Raise Wrong where a reader cannot do it; else return what was done."""
    before = []
    while re.match(r"[A-Z_]+=", words[0]):
        before.append(words.pop(0))
    if words[0] == "timeout":
        del words[:2]
    program, *rest = words
    if program == "rosrun":
        package, program, *rest = rest
        if package != "jaka_ros_driver":
            raise Wrong("no package %s" % package)
    if program in command_places.declared():
        understand(program, rest, written.is_whole)
    elif program in ("roslaunch", "rostest"):
        if rest:
            launched(rest, program)
    elif program == "rosservice":
        service_called(rest)
    elif program == "rostopic":
        topic_used(rest)
    elif program == "rosnode":
        if rest != ["list"]:
            raise Wrong("rosnode %s" % rest)
    elif program == "rosparam":
        if rest[0] != "load" or not (ROOT / rest[1]).is_file():
            raise Wrong("rosparam %s" % rest)
    elif program in ("rosmsg", "rossrv", "rospack"):
        shell(" ".join(words))
        return "run"
    elif program == "tools/dev":
        dev(rest)
    elif program.endswith(("python", "python3")):
        return run_by_python(before, program, rest, target)
    elif program == "pip":
        extras(rest)
    elif program == "apt":
        if rest[0] != "install" or not all(name.startswith("./build/deb/") for name in rest[1:]):
            raise Wrong("apt %s" % rest)
    elif program in (".", "source"):
        if rest[0].startswith("build/") and command_places.place().name != "deb" and not (ROOT / rest[0]).is_file():
            raise Wrong("no %s" % rest[0])
    elif program in (".ci/run", "catkin_lint"):
        if not (os.access(str(ROOT / program), os.X_OK) or shutil.which(program, path="/usr/bin:/bin")):
            raise Wrong("no %s" % program)
    elif program in SHELL_WORDS | {"for", "do", "done", "openssl", "pre-commit", "rosbag"}:
        return "is there"
    else:
        raise Wrong("no command %s is known" % program)
    return "understood"


def checked(written):
    """Return what was done about each command of one line."""
    for text in concrete(written.text):
        if text.startswith("for "):
            shell("bash -n -c %s" % shlex.quote(text))
            yield "understood"
            continue
        target = (re.search(r" > (docs/\S+)$", text) or [None, ""])[1]
        for words in parts(text) if written.is_whole else [shlex.split(text)]:
            yield check(words, written, target)


@pytest.mark.parametrize("where", sorted({written.where.split(",")[0] for written in FOUND}))
def test_what_a_reader_is_told_to_type_is_understood(where):
    if where == "CONTRIBUTING.md" and command_places.place().name == "deb":
        pytest.skip("its commands are those of a checkout with its build")
    wrong = []
    for written in FOUND:
        if written.where.split(",")[0] == where:
            try:
                assert list(checked(written))
            except Wrong as error:
                wrong.append("%s: %s" % (written.text, error))
            except (ValueError, IndexError) as error:
                wrong.append("%s: %r" % (written.text, error))
    assert not wrong, "\n".join(wrong)


# ---- what is quick and harmless is run as it stands, in the order of its page ----

QUICK = {"attach", "cat", "compare", "completion", "convert", "dataset add", "dataset compact", "dataset query",
         "doctor", "du", "export", "extract", "filter", "info", "merge", "plot", "recover", "report", "split", "verify"}
"""Subcommands that read and write files only."""
NOT_HERE = ("s3://", "tcp://", "DIR", "FILE", "FOLDER", "GOLDEN", "--sweep", "~/.ros")
"""Words that ask for a cluster, for a file of the reader's, or for one that such a command or a driver made."""


def is_quick(words):
    words = words[2:] if words[0] == "rosrun" else words
    if words[0] == "jaka_bag":
        return any(" ".join(words[1:]).startswith(name + " ") for name in QUICK)
    return words[0] in ("openssl",) or words[:2] == ["jaka_driver", "--urdf"]


RUN = {page: [written.text for written in FOUND if written.where == page and written.is_whole
              and all(map(is_quick, parts(written.text))) and not any(word in written.text for word in NOT_HERE)]
       for page in sorted({written.where for written in FOUND})}


@pytest.fixture
def folder(tmp_path):
    """Write the files that the pages name, as a user's: two golden logs under their names."""
    golden = ROOT / "test" / "data" / "golden"
    for name in ("golden.mcap", "run.mcap"):
        shutil.copy(str(golden / "joint_moves.mcap"), str(tmp_path / name))
    for name in ("run.bag", "status.bag"):
        assert main(["convert", str(tmp_path / "golden.mcap"), "-o", str(tmp_path / name), "-q"]) == 0
    for number in (1, 2):
        cell = tmp_path / "logs" / ("press_%d" % number)
        cell.mkdir(parents=True)
        shutil.copy(str(golden / "joint_moves.mcap"), str(cell / "day_0.mcap"))
    report = tmp_path / "jaka_reports" / "test_cell.py_test_cell"
    report.mkdir(parents=True)
    shutil.copy(str(golden / "joint_moves.mcap"), str(report / "candidate.mcap"))
    good_runs = tmp_path / "good_runs"
    good_runs.mkdir()
    for number in (1, 2, 3):
        shutil.copy(str(golden / "joint_moves.mcap"), str(good_runs / ("run_%d.mcap" % number)))
    for name in ("tight", "wide"):
        (tmp_path / (name + ".yaml")).write_text("{}\n")
    return tmp_path


def runs_in_english(page):
    """Return whether a Chinese page has the same commands as the page that it says in other words."""
    english = "README.md" if page == "docs/zh/README.md" else page.replace("docs/zh/", "docs/")
    return english != page and RUN[page] == RUN[english]


@pytest.mark.parametrize("page", sorted(page for page, texts in RUN.items() if texts and not runs_in_english(page)))
def test_what_is_quick_runs_as_it_stands(page, folder):
    if command_places.place().name == "deb" and "fleet" in page:
        for package in ("pyarrow", "duckdb"):
            pytest.importorskip(package, reason="this Debian has no python3-" + package)
    bin_folder = folder / "bin"
    bin_folder.mkdir()
    for program in command_places.declared():
        words = " ".join(map(shlex.quote, command_of(program)))
        (bin_folder / program).write_text('#!/bin/sh\nexec %s "$@"\n' % words)
        (bin_folder / program).chmod(0o755)
    for text in RUN[page]:
        for output in re.findall(r" -o (\S+)", text):
            (folder / output).unlink(missing_ok=True)
        done = subprocess.run(["bash", "-c", text], cwd=str(folder), stdin=subprocess.DEVNULL, text=True, timeout=250,
                              stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                              env=dict(os.environ, PATH="%s:%s" % (bin_folder, os.environ["PATH"])))
        assert done.returncode == 0 and "Traceback" not in done.stdout, "%s\n%s" % (text, done.stdout)


# ---- the check itself ----

def test_many_are_found_of_every_kind():
    texts = [written.text for written in FOUND]
    for begin, least in (("rosrun", 25), ("jaka_bag", 70), ("roslaunch", 12), ("rosservice", 25), ("rostopic", 20),
                         ("tools/dev", 20), ("build/venv/bin/python3 test/", 30), ("pip", 5), ("openssl", 2)):
        assert sum(text.startswith(begin) for text in texts) >= least, begin
    assert sum(map(len, RUN.values())) >= 14


def test_each_program_by_hand_says_how_it_is_started():
    told = {written.where for written in FOUND if written.is_whole}
    by_hand = [path.relative_to(ROOT).as_posix() for folder in ("benchmark", "fuzz", "soak")
               for path in (ROOT / "test" / folder).glob("*.py")]
    assert len(by_hand) > 20 and not [name for name in by_hand if name not in told]


@pytest.mark.parametrize("planted", [
    "rosrun jaka_ros_driver jaka_bags info run.bag", "rosrun jaka_driver jaka_bag info run.bag",
    "jaka_bag infos run.bag", "jaka_bag info --no-such run.bag", "jaka_bag convert", "jaka_sim --modell zu7",
    "jaka_sim panel --port 1 dance", "roslaunch jaka_ros_driver demos.launch",
    "roslaunch jaka_ros_driver demo.launch no_such:=1", "rosservice call /jaka_driver/joint_moves",
    'rosservice call /jaka_driver/joint_move "{pos: [0, 0]}"', "rostopic echo /jaka_driver/no_such_topic",
    'rostopic pub -1 /jaka_driver/recover/cancel actionlib_msgs/GoalID "{x: 1}"', "rosmsg show jaka_msgs/NoSuch",
    "tools/dev dance", "tools/dev bench no_such", "tools/dev test test/no_such", "tools/dev simulate --sed 5",
    "python3 test/no_such.py", "python test/benchmark/bench_io.py",
    "build/venv/bin/python3 test/benchmark/bench_io.py many", "build/venv/bin/python3 test/custody/simulate.py --x",
    "PYTHONPATH=. build/venv/bin/python3 test/simulation/test_documentation.py", "pip install ./tools[no_such]",
    "rosnode dance", "no_such_program"])
def test_a_command_that_is_wrong_is_noticed(planted):
    (written,) = of_page("page", "```sh\n%s\n```\n" % planted)
    with pytest.raises((Wrong, RuntimeError, ValueError)):
        assert list(checked(written))


def test_commands_are_found_where_they_stand():
    page = "`roslaunch a b.launch`, `rosbag`\n```sh\nfirst \\\n  --more\n```\n```\njaka_sim panel\n: {\n```\n"
    texts = [written.text for written in of_page("", page)]
    assert texts == ["first --more", "jaka_sim panel", "roslaunch a b.launch"]
    head = "Head.\n\n    tools/dev bench io        20 s\n    not one\n\nSee ``jaka_bag info FILE``."
    assert list(of_head("", head)) == [Written("", "tools/dev bench io", True),
                                       Written("", "jaka_bag info FILE", False)]
    assert concrete("a.py [MINUTES [SEED [NAME ...]]]") == ["a.py", "a.py 1 1 joint_moves"]
    assert parts("A=b x 'c d' > e && y | z # no") == [["A=b", "x", "c d"], ["y"], ["z"]]


def test_the_panel_of_the_simulator_understands_what_its_page_says(root):
    # The actions of the page are sent to a running simulated controller.
    from jaka_ros_driver.simulation.simulated_controller import SimulatedController
    texts = [written.text for written in FOUND if written.where == "docs/simulation.md"
             and written.text.startswith("jaka_sim panel --port")]
    assert len(texts) >= 2
    with SimulatedController(start="enabled") as arm:
        for text in texts:
            words = shlex.split(re.sub(r"--port \d+", "--port %d" % arm.operator_port, text))[1:]
            assert words[3] in ACTIONS
            done = subprocess.run([*command_of("jaka_sim"), *words], stdout=subprocess.PIPE, text=True, timeout=60)
            assert done.returncode == 0, text
