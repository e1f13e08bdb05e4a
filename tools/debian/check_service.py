"""A check that the service jaka-driver@ARM under a running systemd does what docs/security.md says of it.

Runs as root beside systemd, with what the packages install and a simulated controller that is a service, too. Prints a
line for each thing tried; exits 1 where one failed.
"""
import contextlib
import json
import os
import pathlib
import platform
import shutil
import subprocess
import sys
import tempfile
import time
from typing import Any, Callable, Dict, Iterator

from check_installed import PATIENCE_S, check, results, run, until

from jaka_ros_driver.simulation.server.event_loop import ask_operator_port

PANEL_PORT = 10002
UNIT = "jaka-driver@cell.service"
CONFIGURATION = pathlib.Path("/etc/jaka/cell.conf")
EXAMPLES = pathlib.Path("/usr/share/doc/python3-jaka-ros-driver/examples")
EXAMPLE = EXAMPLES / "example.conf"
CUSTODY = pathlib.Path("/run/jaka-driver/cell/jaka_ros_driver")
MOVE = "rosservice call /jaka_driver/joint_move '{pose: [%g, 1.2, -1.2, 1.57, 1.57, 0.5], mvvelo: %g, mvacc: 2.0}'"


def state() -> Dict[str, Any]:
    """Return what is true of the simulated arm."""
    found: Dict[str, Any] = ask_operator_port(PANEL_PORT, {"action": "state"})["state"]
    return found


def shown(name: str) -> str:
    """Return a property of the unit."""
    return run("systemctl show --property=%s --value %s" % (name, UNIT)).strip()


def require(condition: Callable[[], object], what: str, patience: float = PATIENCE_S) -> float:
    """Wait until something holds; return how long that took, s. Raises AssertionError where it does not come."""
    begun = time.monotonic()
    while not condition():
        assert time.monotonic() - begun < patience, what
        time.sleep(0.01)
    return time.monotonic() - begun


def said(words: str, since: float) -> bool:
    """Return whether the unit's journal contains these words since a time, s since 1970."""
    return words in run("journalctl --no-pager --output=cat --unit=%s --since=@%d" % (UNIT, since))


def processes() -> str:
    """Return the processes of the unit."""
    group = pathlib.Path("/sys/fs/cgroup" + shown("ControlGroup"), "cgroup.procs")
    return group.read_text() if shown("ControlGroup") and group.exists() else ""


def ready() -> None:
    """Wait for the driver, and power and enable the arm by its services."""
    require(lambda: shown("ActiveState") == "active", "the unit is active")
    for service in ("power", "enable"):
        def called(service: str = service) -> str:
            answer = run("rosservice call /jaka_driver/%s 'data: true'" % service)
            assert "success: True" in answer, answer
            return answer
        until(called, service)
    assert state()["is_enabled"]


@contextlib.contextmanager
def moving() -> Iterator["subprocess.Popen[str]"]:
    """Have the arm move for a long time; its caller gets an answer in the end."""
    target = 2.5 if state()["joint_position"][0] < 0 else -2.5
    with subprocess.Popen(["bash", "-c", MOVE % (target, 0.15)], stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                          text=True) as caller:
        require(lambda: state()["is_moving"], "the arm moves")
        yield caller
        caller.communicate(timeout=PATIENCE_S)


def rests(what: str) -> str:
    """Return how long it took until the arm was at rest; it must not move again by itself."""
    seconds = require(lambda: not state()["is_moving"], "the arm rests after " + what, 10.0)
    where = state()["joint_position"]
    time.sleep(1.0)  # what must not come has no other sign
    assert state()["joint_position"] == where, "it moves again"
    return "at rest after %.2f s" % seconds


def incomplete() -> str:
    """Check that a configuration without address and model starts no driver, and that the journal says why."""
    CONFIGURATION.parent.mkdir(exist_ok=True)
    shutil.copy(str(EXAMPLE), str(CONFIGURATION))
    begun = time.time()
    assert subprocess.run(["systemctl", "start", UNIT], stderr=subprocess.DEVNULL).returncode != 0
    require(lambda: said("/etc/jaka/cell.conf sets no IP or no MODEL", begun), "the journal says why")
    run("systemctl stop %s; systemctl reset-failed %s || true" % (UNIT, UNIT))
    return ""


def started() -> str:
    """Check that the driver runs without rights as a user of its own, and powers nothing."""
    text = EXAMPLE.read_text().replace("IP=\n", "IP=127.0.0.1\n").replace("MODEL=\n", "MODEL=zu7\n")
    CONFIGURATION.write_text(text)
    run("systemctl start " + UNIT)
    until(lambda: run("rosservice info /jaka_driver/enable"), "the driver offers its services")
    time.sleep(1.0)  # what must not come has no other sign
    assert not state()["is_powered"]
    status = pathlib.Path("/proc", shown("MainPID"), "status").read_text()
    facts = dict(line.split(":\t", 1) for line in status.splitlines() if ":\t" in line)
    assert facts["Uid"].split()[0] != "0" and int(facts["CapEff"], 16) == 0, facts
    assert facts["NoNewPrivs"] == "1" and facts["Seccomp"] == "2", facts
    assert len(processes().split()) == 2, "driver and guard: %s" % processes()
    return "user %s, no capability, system calls filtered" % facts["Uid"].split()[0]


def moved() -> str:
    """Check that a caller of the driver's services moves the arm."""
    ready()
    answer = run(MOVE % (0.3, 1.0))
    assert "ret: 1" in answer, answer
    return ""


def restarted() -> str:
    """Check that a restart during a move stops the arm, that nothing resumes, and that the arm can be moved again."""
    with moving() as caller:
        old = shown("MainPID")
        asked = time.monotonic()
        run("systemctl --no-block restart " + UNIT)
        told = rests("restart")
        answer = caller.communicate(timeout=PATIENCE_S)[0]
        assert "driver shut down" in answer, answer
    require(lambda: shown("ActiveState") == "active" and shown("MainPID") not in ("0", old), "another one runs")
    took = time.monotonic() - asked
    moved()
    return "%s, another driver %.1f s after" % (told, took)


def killed() -> str:
    """Check that the guard of a driver killed during a move stops the arm and ends, and that systemd starts a new
    one.
    """
    with moving():
        before, begun = int(shown("NRestarts")), time.time()
        run("systemctl kill --kill-whom=main --signal=KILL " + UNIT)
        told = rests("SIGKILL")
        assert said("the driver has died while the arm moves", begun) and said("the arm is at rest", begun)
    require(lambda: int(shown("NRestarts")) == before + 1 and shown("ActiveState") == "active", "it is started again")
    until(lambda: run("rosservice info /jaka_driver/enable"), "the next driver offers its services")
    assert not state()["is_moving"] and len(processes().split()) == 2, processes()
    assert not list(CUSTODY.glob("custody.*")), "the guard has left a custody file"
    moved()
    return told


def frozen() -> str:
    """Check that the guard stops the arm when the driver hangs in a move while all of its service is asked to end."""
    with moving():
        begun = time.time()
        run("systemctl kill --kill-whom=main --signal=STOP " + UNIT)
        run("systemctl kill --kill-whom=all --signal=TERM " + UNIT)
        told = rests("a hang")
        assert said("the driver is silent while the arm moves", begun) and said("the arm is at rest", begun)
        run("systemctl stop " + UNIT)
    require(lambda: shown("ActiveState") == "inactive" and not processes(), "nothing of it is left")
    return told


def early() -> str:
    """Check that a driver that is started before the ROS master waits for it, without a second start."""
    run("systemctl stop roscore")
    run("systemctl start --no-block " + UNIT)
    time.sleep(12.0)  # what must not come has no other sign
    assert shown("ActiveState") == "activating" and shown("NRestarts") == "0", shown("NRestarts")
    run("systemctl start roscore")
    seconds = require(lambda: shown("ActiveState") == "active", "it is active with the master")
    return "active %.1f s after the master" % seconds


def watched() -> str:
    """Check that systemd ends a driver that hangs at rest, notes its threads, and starts one that powers nothing."""
    ready()
    before, begun = int(shown("NRestarts")), time.time()
    run("systemctl kill --kill-whom=main --signal=STOP " + UNIT)
    seconds = require(lambda: shown("Result") == "watchdog" or int(shown("NRestarts")) > before, "it is ended")
    require(lambda: int(shown("NRestarts")) > before and shown("ActiveState") == "active", "another one runs")
    assert said("Fatal Python error: Aborted", begun) and said("arm_client.py", begun), "where its threads stood"
    run("systemctl stop " + UNIT)
    return "ended after %.1f s" % seconds


def stopped() -> str:
    """Check that a stop of the service during a move stops the arm and leaves no process."""
    run("systemctl start " + UNIT)
    moved()
    with moving():
        run("systemctl stop " + UNIT)
        told = rests("stop")
    assert shown("ActiveState") == "inactive" and shown("Result") == "success"
    require(lambda: not processes(), "nothing of it is left")
    return told


def judged() -> str:
    """Check that systemd finds no mistake in the unit and grants it few rights; return its exposure level."""
    text = run("systemd-analyze verify --man=no " + UNIT)
    assert "jaka" not in text, text
    lines = run("systemd-analyze security --no-pager --threshold=15 " + UNIT).splitlines()
    return next(line for line in lines if "Overall exposure level" in line).strip("→ ")


def main() -> int:
    """Try everything; returns 1 where something failed."""
    os.chdir(tempfile.mkdtemp())
    os.environ.update(ROS_HOSTNAME="localhost", ROS_MASTER_URI="http://localhost:11311")
    print("Python %s, %s" % (platform.python_version(), run("systemctl --version").splitlines()[0]), flush=True)
    service = "systemd-run --quiet --setenv=ROS_HOSTNAME=localhost --setenv=HOME=/root --unit="
    shutil.copy(str(EXAMPLES / "roscore.service"), "/etc/systemd/system")
    run("systemctl daemon-reload && systemctl start roscore")
    run("%stest-controller jaka_sim --power-delay 0.1 --enable-delay 0.1 --panel-port %d" % (service, PANEL_PORT))
    until(lambda: json.dumps(state()), "the simulated controller runs")
    for name, attempt in (
            ("systemd-analyze verify, security", judged), ("no address, no model: no driver", incomplete),
            ("starts without rights, powers nothing", started), ("~power, ~enable, ~joint_move", moved),
            ("systemctl restart in a move", restarted), ("SIGKILL of the driver in a move", killed),
            ("a hang in a move, SIGTERM to all, stop", frozen), ("systemctl stop in a move", stopped),
            ("started before the master", early), ("a hang at rest", watched)):
        check(name, attempt)
    failed = [name for name, result in results.items() if result != "works"]
    print("service: %d passed, %d failed" % (len(results) - len(failed), len(failed)), flush=True)
    if failed:
        print(run("journalctl --no-pager --output=cat --lines=60 --unit=" + UNIT))
    shutil.rmtree(str(CONFIGURATION.parent))
    return int(bool(failed))


if __name__ == "__main__":
    sys.exit(main())
