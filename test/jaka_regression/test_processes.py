"""Child processes that are started, read and ended; none stays behind."""
import os
import signal
import subprocess
import time

import pytest

from jaka_regression.command_lines import MASTER, OPERATOR_SESSION, SIMULATION
from jaka_regression.processes import ChildProcess, ChildProcesses, ProcessFailed

WAIT = 30.0
SLEEPER = "import time\nprint('{\"up\": 1}', flush=True)\ntime.sleep(600)"
STUBBORN = ("import signal, time\nfor n in (signal.SIGINT, signal.SIGTERM): signal.signal(n, signal.SIG_IGN)\n"
            "print('up', flush=True)\ntime.sleep(600)")
ECHO = "import sys\nfor line in sys.stdin: print('heard ' + line.strip(), flush=True)"


def is_gone(process):
    try:
        os.kill(process.process.pid, 0)
    except ProcessLookupError:
        return True
    return False


def test_what_it_prints_is_heard_and_kept(tmp_path):
    with ChildProcesses() as processes:
        process = processes.begin("sleeper", ["-c", SLEEPER], tmp_path)
        assert process.first_object(WAIT) == {"up": 1}
        processes.check()
        process.wait_for_words('"up"', WAIT)
    assert is_gone(process)
    assert "KeyboardInterrupt" in (tmp_path / "sleeper.log").read_text()


def test_it_is_spoken_to(tmp_path):
    heard = []
    with ChildProcesses() as processes:
        process = processes.begin("echo", ["-c", ECHO], tmp_path, on_line=heard.append)
        process.say("one")
        assert process.first_line(WAIT) == "heard one"
    assert heard == ["heard one"]


def test_an_end_is_an_error_with_its_last_words(tmp_path):
    with ChildProcesses() as processes:
        process = processes.begin("short", ["-c", "raise SystemExit('no more')"], tmp_path)
        with pytest.raises(ProcessFailed, match="short ended: no more"):
            process.first_line(WAIT)
        with pytest.raises(ProcessFailed, match="no more"):
            processes.check()
        with pytest.raises(ProcessFailed, match="no more"):
            process.wait_for_words("something", WAIT)


def test_silence_and_nonsense_are_errors(tmp_path):
    with ChildProcesses() as processes:
        process = processes.begin("stubborn", ["-c", STUBBORN], tmp_path)
        with pytest.raises(ProcessFailed, match="printed 'up'"):
            process.first_object(WAIT)
        with pytest.raises(ProcessFailed, match="says nothing"):
            process.first_line(0.1)
        with pytest.raises(ProcessFailed, match="did not print"):
            process.wait_for_words("something", 0.1)
        process.end(signal.SIGKILL)


@pytest.mark.parametrize("arguments", [
    MASTER, [*SIMULATION, "--command-port", "0", "--status-port", "0"], [*OPERATOR_SESSION, "10001"]],
    ids=["master", "simulation", "panel session"])
def test_what_inherits_an_ignored_interrupt_is_ended_by_one_all_the_same(tmp_path, arguments):
    if arguments is MASTER:
        pytest.importorskip("rosmaster")
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        process = ChildProcess("background", arguments, tmp_path)
    finally:
        signal.signal(signal.SIGINT, before)
    process.first_line(WAIT)
    assert process.end() in (0, -signal.SIGINT)


def test_impatience_ends_the_rest_at_once(tmp_path, monkeypatch):
    started = time.monotonic()
    processes = ChildProcesses()
    running = [processes.begin("stubborn%d" % i, ["-c", STUBBORN], tmp_path) for i in range(2)]
    for process in running:
        process.first_line(WAIT)
    ends = ChildProcess.end

    def interrupted(process, number=signal.SIGINT):
        if number is signal.SIGINT:
            raise KeyboardInterrupt
        return ends(process, number)

    monkeypatch.setattr(ChildProcess, "end", interrupted)
    with pytest.raises(KeyboardInterrupt):
        processes.__exit__(None, None, None)
    assert all(is_gone(process) for process in running)
    assert time.monotonic() - started < WAIT


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupt_that_finds_one_being_begun_ends_it_too(tmp_path, monkeypatch, number):
    begun = []
    popen = subprocess.Popen

    def interrupted(*arguments, **settings):
        begun.append(popen(*arguments, **settings))
        signal.raise_signal(number)
        return begun[-1]

    def interrupt(number, frame):
        raise KeyboardInterrupt

    before = signal.signal(number, interrupt)
    try:
        monkeypatch.setattr(subprocess, "Popen", interrupted)
        with pytest.raises(KeyboardInterrupt), ChildProcesses() as processes:
            processes.begin("sleeper", ["-c", SLEEPER], tmp_path)
        assert signal.getsignal(number) is interrupt
    finally:
        signal.signal(number, before)
        for process in begun:
            was_left = process.poll() is None
            process.kill()
            process.wait(WAIT)
    assert len(begun) == 1 and not was_left


def test_variables_are_added_and_taken_out(tmp_path, monkeypatch):
    monkeypatch.setenv("JAKA_TEST_OUT", "1")
    code = "import os\nprint(os.environ.get('JAKA_TEST_OUT'), os.environ['JAKA_TEST_IN'], flush=True)"
    with ChildProcesses() as processes:
        process = processes.begin("env", ["-c", code], tmp_path, {"JAKA_TEST_OUT": None, "JAKA_TEST_IN": "x"})
        assert process.first_line(WAIT) == "None x"
