"""A check of what the packages install: the demo, the README's commands, every command, man pages, completions.

argv: the README; the time at which apt began to install, s since 1970. Prints a line for each thing tried; exits 1
where one failed. Runs with the installed Python and its standard library alone, in a network namespace of its own.
"""
import contextlib
import json
import os
import pathlib
import platform
import re
import signal
import socket
import subprocess
import sys
import tempfile
import time
import urllib.request
from typing import Callable, Dict, Iterator, List

PATIENCE_S = 240.0
"""Longest wait, s, for a command of the installed packages: roslaunch and a driver's start on a slow machine."""
ENVIRONMENT = {**os.environ, "ROS_HOSTNAME": "localhost", "PYTHONUNBUFFERED": "1"}
EXECUTABLES = {"check_moveit_config": [], "jaka_bag": [], "jaka_doctor": [], "jaka_driver": [], "jaka_foxglove": [],
            "jaka_panel": [], "jaka_probe": [], "jaka_sim": ["panel", "proxy"], "migrate_cell": []}
ANSWERS = {"get_fk": "cartesian_pose: [", "rostopic hz": "average rate", "jaka_bag info": "messages"}
"""Text that the output of some of the README's commands must contain, besides an exit code of 0."""
results: Dict[str, str] = {}


def run(command: str) -> str:
    """Return the output of a command of the shell; raises AssertionError where it fails."""
    done = subprocess.run(["bash", "-c", command], env=ENVIRONMENT, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                          stderr=subprocess.STDOUT, timeout=PATIENCE_S)
    text = done.stdout.decode("utf-8", "replace")
    assert done.returncode == 0, "%s: exit %d\n%s" % (command, done.returncode, text)
    return text


def until(attempt: Callable[[], str], what: str) -> str:
    """Return what an attempt returns once it raises nothing."""
    deadline = time.monotonic() + PATIENCE_S
    while True:
        try:
            return attempt()
        except (AssertionError, IndexError, OSError, ValueError, subprocess.TimeoutExpired) as error:
            if time.monotonic() > deadline:
                raise AssertionError("%s: %s" % (what, error)) from None
        time.sleep(0.5)


def check(name: str, attempt: Callable[[], object]) -> None:
    """Try one thing, and note how it went."""
    begun = time.monotonic()
    try:
        told = attempt()
        results[name] = "works"
    except Exception as error:  # whatever it is, the next thing is tried
        told = error
        results[name] = "FAILED"
    seconds = time.monotonic() - begun
    lines = str(told or "").strip().splitlines()
    shown = "\n".join(lines) if results[name] == "FAILED" else "".join(lines[-1:])
    print("%-44s %-7s %6.1f s  %s" % (name, results[name], seconds, shown), flush=True)


@contextlib.contextmanager
def running(*command: str, log: str) -> Iterator["subprocess.Popen[bytes]"]:
    """Run a command beside this one; it is asked to end with the context, and must."""
    with open(log, "wb") as file:
        process = subprocess.Popen(command, env=ENVIRONMENT, stdin=subprocess.DEVNULL, stdout=file,
                                   stderr=subprocess.STDOUT)
    try:
        yield process
    finally:
        process.send_signal(signal.SIGINT)
        try:
            process.wait(30)
        except subprocess.TimeoutExpired:
            process.kill()


def readme_commands(page: str) -> List[str]:
    """Return the commands below the README's heading "In another shell" but the one that sets a shell up."""
    text = pathlib.Path(page).read_text(encoding="utf-8").split("\n## In another shell\n")[1]
    block = re.findall(r"```sh\n(.*?)```", text, re.DOTALL)[0]
    commands = [line for line in block.splitlines() if line and not line.startswith(". ")]
    assert len(commands) >= 8, "the README's block is not where it was: %s" % commands
    return commands


def demo(page: str, started: float) -> None:
    """Start the demo, move its arm, fetch its page, and run the README's commands."""
    commands = readme_commands(page)
    move = commands.pop(0)
    assert "joint_move" in move
    with running("roslaunch", "jaka_ros_driver", "demo.launch", log="demo.log") as launched:
        def moved() -> str:
            if launched.poll() is not None:
                raise RuntimeError("roslaunch has ended: " + pathlib.Path("demo.log").read_text()[-2000:])
            answer = run(move)
            assert "ret: 1" in answer, answer
            return "the arm has moved %.0f s after apt install began" % (time.time() - started)
        check("demo.launch, " + move.split()[2], lambda: until(moved, "the arm moves"))

        def fetched() -> str:
            address = until(lambda: re.findall(r"open (http://\S+)", pathlib.Path("demo.log").read_text())[0], "a page")
            base = address.split("#")[0]
            sizes = [len(urllib.request.urlopen(base + name, timeout=30).read())
                     for name in ("", "web/js/app.js", "web/vendor/three/three.module.js")]
            assert min(sizes) > 500, sizes
            return "%d bytes of page, %d of its script" % (sizes[0], sizes[1])
        check("jaka_panel: its page", fetched)
        for command in commands:
            def readme_command(command: str = command) -> str:
                text = run(command if not command.startswith("timeout") else command + " || [ $? = 124 ]")
                for word, wanted in ANSWERS.items():
                    assert word not in command or wanted in text, text
                return ""
            check("README: " + command.split("{")[0].replace("rosrun jaka_ros_driver ", "")[:34], readme_command)
        check("convert to rosbag2 with CDR (rosbags)", lambda: run(
            "jaka_bag convert --profile ros2 run.bag run_ros2 && jaka_bag info run_ros2 | grep -q messages"))
        check("jaka_bag doctor run.bag", lambda: run("jaka_bag doctor run.bag"))
        check("jaka_foxglove", foxglove)
        check("rosmsg, rossrv", lambda: run("rosmsg show jaka_msgs/RobotMsg && rossrv show jaka_msgs/Move"))


def foxglove() -> str:
    """Serve the running system, and connect to the port."""
    with running("jaka_foxglove", "--port", "8765", log="foxglove.log"):
        def connected() -> str:
            with socket.create_connection(("127.0.0.1", 8765), 5):
                return ""
        return until(connected, "jaka_foxglove listens")


def wire_log() -> str:
    """Have the simulated controller log its bytes, which needs the package mcap."""
    with running("jaka_sim", "--command-port", "0", "--status-port", "0", "--poll-port", "0", "--log", "wire.mcap",
                 log="sim.log"):
        def answers() -> str:
            ports = json.loads(pathlib.Path("sim.log").read_text().splitlines()[0])
            with socket.create_connection(("127.0.0.1", ports["command_port"]), 5) as link:
                link.sendall(b'{"cmdName":"get_joint_pos"}')
                assert link.recv(4096).startswith(b"{")
            return ""
        until(answers, "jaka_sim answers")
    return run("jaka_bag info wire.mcap | grep messages | head -n 1")


def documents() -> str:
    """Count the man pages and try the completions."""
    pages = sorted(path.name for path in pathlib.Path("/usr/share/man/man1").iterdir()
                   if path.name.split(".")[0].split("-")[0] in EXECUTABLES)
    for executable, commands in EXECUTABLES.items():
        for name in [executable] + ["%s-%s" % (executable, command) for command in commands]:
            assert name + ".1.gz" in pages, name
    for executable in set(EXECUTABLES) - {"jaka_foxglove"}:
        run(". /usr/share/bash-completion/completions/%s && complete -p %s" % (executable, executable))
        assert pathlib.Path("/usr/share/zsh/vendor-completions/_" + executable).exists()
    return "%d man pages" % len(pages)


def unit() -> str:
    """Look for the unit, which is not enabled."""
    unit_file, = (path for folder in ("/lib/systemd/system", "/usr/lib/systemd/system")
                  for path in [pathlib.Path(folder, "jaka-driver@.service")] if path.exists() and not (
                      folder == "/usr/lib/systemd/system" and pathlib.Path("/lib").is_symlink()))
    assert not list(pathlib.Path("/etc/systemd").rglob("jaka*"))
    return str(unit_file)


def main() -> int:
    """Try everything; returns 1 where something failed."""
    page, started = sys.argv[1], float(sys.argv[2])
    os.chdir(tempfile.mkdtemp())
    rospy = run("dpkg-query -W -f='${Version}' python3-rospy")
    print("Python %s, rospy %s" % (platform.python_version(), rospy), flush=True)
    demo(page, started)
    for executable, commands in EXECUTABLES.items():
        for command in ["", *commands]:
            name = ("%s %s" % (executable, command)).strip()
            check(name + " --help", lambda name=name: run(name + " --help") and "")
    subcommands = re.findall(r"^  ((?:dataset )?[a-z-]+) +\w", run("jaka_bag --help"), re.MULTILINE)
    check("all %d subcommands of jaka_bag --help" % len(subcommands),
          lambda: [run("jaka_bag %s --help" % name) for name in subcommands] and "")
    check("jaka_driver --urdf zu7", lambda: run("jaka_driver --urdf zu7 | grep -c '<joint'"))
    check("jaka_sim --log (mcap)", wire_log)
    check("man pages and completions", documents)
    check("jaka-driver@.service", unit)
    failed = [name for name, result in results.items() if result != "works"]
    print("commands: %d passed, %d failed" % (len(results) - len(failed), len(failed)), flush=True)
    if failed and pathlib.Path("demo.log").exists():
        print(pathlib.Path("demo.log").read_text()[-3000:])
    return int(bool(failed))


if __name__ == "__main__":
    sys.exit(main())
