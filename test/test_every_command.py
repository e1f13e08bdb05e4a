"""The subcommands of all executables, as each one's own parser has them, started from the place under test.

Its help, its examples on real logs, and each option that spreads work over processes, with two of them.
"""
import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import command_places
import pytest
from command_parsers import commands, needs_ros, parser
from command_places import command_of, place
from dask_cluster import DaskCluster
from import_graph import ROOT

from jaka_bag.cli.main import COMMANDS, load_command, main

GOLDEN = ROOT / "test" / "data" / "golden"
EVERY = list(commands())
PATIENCE_S = 250


def run(folder, text, **options):
    """Run a line of the shell with the executables of the place under test; return exit code and output."""
    for executable in {word for word in shlex.split(text) if word in command_places.declared()}:
        text = re.sub(r"\b%s " % executable, " ".join(map(shlex.quote, command_of(executable))) + " ", text)
    done = subprocess.run(["bash", "-c", text], cwd=str(folder), stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                          stderr=subprocess.STDOUT, text=True, timeout=PATIENCE_S, **options)
    assert "Traceback" not in done.stdout, "%s\n%s" % (text, done.stdout)
    return done.returncode, done.stdout


def need(executable, words):
    if needs_ros(executable):
        pytest.importorskip("rospy", reason="%s needs ROS" % executable)
    if place().name == "wheel" and words and executable == "jaka_bag" and brought_by_ros(words):
        pytest.skip("comes with the ROS package")


def need_tables(name):
    """Skip what Debian lacks packages for; in every other place they are there, and must be."""
    if place().name == "deb" and name.split()[0] in ("compare", "dataset", "export"):
        pytest.importorskip("pyarrow", reason="this Debian has no python3-pyarrow")
    if place().name == "deb" and name == "dataset query":
        pytest.importorskip("duckdb", reason="Debian has no python3-duckdb")


def brought_by_ros(words):
    return bool(COMMANDS[" ".join(words)].needs)


# ---- help ----

@pytest.mark.parametrize("executable, words", EVERY, ids=[" ".join([name, *words]) for name, words in EVERY])
def test_its_help_tells_every_option_of_its_parser(executable, words, tmp_path):
    need(executable, words)
    code, said = run(tmp_path, " ".join([executable, *words, "--help"]), env=dict(os.environ, COLUMNS="98"))
    assert code == 0 and said.startswith("usage: " + " ".join([executable, *words])), said
    if executable != "jaka_bag" or words:
        options = [option for action in parser(executable, words)._actions if action.help != "==SUPPRESS=="
                   for option in action.option_strings]
        assert options and not [option for option in options if not re.search(r"%s\b" % re.escape(option), said)]


def test_the_walk_finds_what_is_there():
    assert {executable for executable, _ in EVERY} == set(command_places.declared())
    assert {" ".join(words) for executable, words in EVERY if executable == "jaka_bag"} == {"", *COMMANDS}
    assert ("jaka_sim", ["proxy"]) in EVERY and ("jaka_sim", ["panel"]) in EVERY


NEVER_EMPTY = {"--black-box", "--dask", "--key", "--sign", "--signature", "--tls-cert", "--tls-key", "--token-file"}
"""Options without which a executable does something else, perhaps unsigned or open: "" must not be taken for none."""
EVERYWHERE = {"--host"}
"""Options whose empty address a listener would take for every address."""
REFUSING = [(executable, words, option) for executable, words in EVERY if (executable, words) != ("jaka_bag", [])
            and not (words == ["info"]) and executable != "jaka_sim" and not needs_ros(executable)
            for action in parser(executable, words)._actions for option in action.option_strings
            if option in NEVER_EMPTY | EVERYWHERE]


@pytest.mark.parametrize("executable, words, option", REFUSING, ids=[" ".join([a, *b, c]) for a, b, c in REFUSING])
def test_an_option_that_is_given_empty_is_refused(executable, words, option, tmp_path):
    # as by ``--sign "$KEY"``, where the shell has no such variable
    need(executable, words)
    code, said = run(tmp_path, " ".join([executable, *words, option, "''", "file"]))
    assert code == 2 and re.search("argument .*%s.*: it is empty" % option, said), said


# ---- examples ----

NOT_HERE = ("s3://", "tcp://", "--against-driver", "record", "play", "serve", "replay")
"""Options and commands that need a running system, or a cluster, and have tests of their own."""
ABOUT_THIS_LOG = (" -s ", " -x ", "--sweep", "report", "verify")
"""Options and commands that ask for a time, a topic or a signature that these logs lack: then one line reports it."""


FAILS_IN_A_LINE = re.compile(r"^jaka_bag[a-z ]*: error: .+\n\Z|: NOT VERIFIED: ", re.MULTILINE)


def examples(name):
    text = getattr(load_command(name), "EPILOG", "").partition("examples:\n")[2]
    found = re.findall(r"^  (jaka_bag %s(?: \S+)*)" % name, text, re.MULTILINE)  # a remark stands after two spaces
    return [line for line in found if not any(word in line for word in NOT_HERE)]


@pytest.fixture
def folder(tmp_path):
    """Write small logs under the names that the examples have."""
    source = GOLDEN / "joint_moves.mcap"
    for name in ("run", "golden", "today", "camera", "damaged", "blackbox_2026-05-04-10-11-12_emergency_stop"):
        shutil.copy(str(source), str(tmp_path / (name + ".mcap")))
    with (tmp_path / "damaged.mcap").open("r+b") as stream:
        stream.truncate(source.stat().st_size * 2 // 3)
    assert main(["convert", str(source), "-o", str(tmp_path / "run.bag"), "-q"]) == 0
    for name in ("run_0.bag", "run_1.bag", "arm.bag", "today.bag", "run.bag.active"):
        shutil.copy(str(tmp_path / "run.bag"), str(tmp_path / name))
    for name in ("calibration.yaml", "cell.yaml", "wide.yaml", "tight.yaml"):
        (tmp_path / name).write_text("{}\n")
    for cell, compression in (("press_1", "lz4"), ("press_2", "none")):  # logs of the same bytes would be one log
        (tmp_path / "logs" / cell).mkdir(parents=True)
        assert main(["convert", str(source), "-o", str(tmp_path / "logs" / cell / "day.bag"), "-c", compression,
                     "-q"]) == 0
    shutil.copy(str(source), str(tmp_path / "logs" / "day.mcap"))
    (tmp_path / "good_runs").mkdir()
    for name in ("today.mcap", "run.bag", "today.bag"):
        shutil.copy(str(tmp_path / name), str(tmp_path / "good_runs"))
    (tmp_path / ".zfunc").mkdir()
    return tmp_path


def outputs_of(name, words):
    """Return files that an example makes: those that are there already are not overwritten, as they should not be."""
    given = parser("jaka_bag", words[1:]).parse_intermixed_args(words[1 + len(name.split()):])
    if name == "split":
        return list(Path().glob("run_*.bag"))
    last = words[-1] if name == "merge" and given.output is None else None
    return [Path(path) for path in (getattr(given, "output", None), getattr(given, "target", None), last)
            if path and Path(path).is_file()]


@pytest.mark.parametrize("name", [name for name in COMMANDS if examples(name)])
def test_the_examples_of_its_help_run(name, folder, monkeypatch):
    monkeypatch.chdir(folder)
    need("jaka_bag", name.split())
    need_tables(name)
    if name in ("dataset query", "dataset compact"):
        assert run(folder, "jaka_bag dataset add logs --to fleet --jobs 1 -q")[0] == 0
    for line in examples(name):
        words = shlex.split(re.split(" [|>] ", line)[0])
        for output in outputs_of(name, words):
            output.unlink(missing_ok=True)
        code, said = run(folder, line, env=dict(os.environ, HOME=str(folder)))
        if any(word in line for word in ABOUT_THIS_LOG):
            assert code == 0 or FAILS_IN_A_LINE.search(said), "%s\n%s" % (line, said)
        else:
            assert code == 0 or (name in ("recover",) and code == 1), "%s\n%s" % (line, said)


# ---- more than one process ----

SPREAD = {"--jobs": "2", "--dask": "{scheduler}"}
SPREAD_WORK = re.compile(r"\bat a time\b|\bDask scheduler\b|\bprocesses at\b")
"""Phrases by which the help of an option announces that it spreads work."""
WORK = {
    "compare": ("{golden} --against logs --results results", "2 runs: 2 same"),
    "convert": ("logs --json", '"failed": 0'),
    "dataset add": ("logs --to fleet", "fleet: 2 logs added"),
    "replay": ("two_logs --time-scale 4 --tolerances {busy}", "2 golden logs: 2 same"),
}
"""The work of each of these commands in several processes, and its output then."""
SPREADING = [(" ".join(words), option) for executable, words in EVERY if executable == "jaka_bag" and words
             for action in parser(executable, words)._actions
             for option in action.option_strings[-1:] if SPREAD_WORK.search(action.help or "")]


def test_every_option_that_spreads_work_is_known():
    assert {name for name, _ in SPREADING} == set(WORK) and len(SPREADING) >= 8
    assert {option for _, option in SPREADING} == set(SPREAD)
    named = {option for executable, words in EVERY if words for action in parser(executable, words)._actions
             for option in action.option_strings if re.search("jobs|workers|processes|dask", option)}
    assert named == set(SPREAD)


@pytest.fixture(scope="module")
def scheduler(tmp_path_factory):
    python = None
    if place().name in ("wheel", "deb"):
        python = place().prefix / "bin" / "python" if place().name == "wheel" else Path(sys.executable)
    with DaskCluster(tmp_path_factory.mktemp("cluster"), python=python) as cluster:
        yield cluster.address


@pytest.mark.parametrize("name, option", SPREADING)
def test_an_option_that_spreads_work_does_it_with_two_workers(name, option, folder, request):
    need("jaka_bag", name.split())
    need_tables(name)
    if name == "replay":
        pytest.importorskip("rospy", reason="a driver needs ROS")
    if option == "--dask":
        pytest.importorskip("distributed")
    (folder / "logs" / "day.mcap").unlink()
    (folder / "two_logs").mkdir()
    for log in ("io_sequence", "boot"):
        for suffix in (".mcap", ".yaml"):
            shutil.copy(str(GOLDEN / (log + suffix)), str(folder / "two_logs"))
    text, told = WORK[name]
    value = SPREAD[option].format(scheduler=request.getfixturevalue("scheduler") if option == "--dask" else "")
    code, said = run(folder, "jaka_bag %s %s %s %s" % (name, text.format(
        golden=GOLDEN / "joint_moves.mcap", busy=ROOT / "test" / "data" / "busy_host.yaml"), option, value))
    assert code == 0 and told in said, said
