"""The command jaka_probe: its options, the stages in order, and what it leaves."""
import argparse
import contextlib
import json
import signal
import sys
import time
from pathlib import Path
from typing import Any, Dict, Iterator, List, Optional

from jaka_ros_driver.client.guard import Guard
from jaka_ros_driver.commands import Query
from jaka_ros_driver.errors import JakaError
from jaka_ros_driver.probe import report
from jaka_ros_driver.probe.ask import ODD, QUESTIONS, ask, frames_of
from jaka_ros_driver.probe.facts import Fact, Facts, ProbeStage
from jaka_ros_driver.probe.fit import SampledCurve
from jaka_ros_driver.probe.identity import identity_in
from jaka_ros_driver.probe.look import HeardFeed, listen, look
from jaka_ros_driver.probe.motion import ROOM_M, MotionEnded, Mover
from jaka_ros_driver.probe.move import ASKED, MOVES, move, why_not
from jaka_ros_driver.probe.moving import AXIS
from jaka_ros_driver.probe.page import page
from jaka_ros_driver.probe.pendant_steps import PROGRAM_MOVES
from jaka_ros_driver.probe.person import Person
from jaka_ros_driver.probe.recorded import ConnectionLog
from jaka_ros_driver.probe.set_same import (
    HOLD_S,
    SETTINGS,
    Desk,
    SetBack,
    StageEnded,
    handled_by,
    set_same,
    uninterrupted,
)
from jaka_ros_driver.probe.twin import twin_facts
from jaka_ros_driver.protocol.ports import PORT_NUMBERS
from jaka_ros_driver.ros.driver_lock import DriverLock, holder_of
from jaka_ros_driver.state import FRESH_S, unrest
from jaka_ros_driver.wire.startup import port_number

_NAME = "jaka_probe"
_SECONDS = 30.0
"""Default time, s, of listening: 300 frames of the slowest feed (10 Hz), and rare pauses are among them."""
_SETTLE_S = 1.2 * FRESH_S
"""Time, s, for which the feed is listened to before a stage: frames that waited to be read are old after it."""
_GLANCE_S = 0.01
"""Time, s, of a look at frames while a person is asked: longer than one cycle (8 ms)."""
_HIGHEST_OUTPUT = 15
_LONGEST_NAME = 200
"""Longest name of a program, characters: one line of the report holds it."""
REPORT, TEXT, PAGE, DIALECT, WIRE = "probe.json", "probe.txt", "probe.html", "dialect.json", "wire.mcap"
_FILES = (REPORT, TEXT, PAGE, DIALECT, WIRE)
_EPILOG = """\
Stages: look sends nothing; it reads the status port. ask, the default, goes on to read values on the command port.
Neither sets, moves or powers anything. set writes values that are there already, and sets back what it changes; it
moves and powers nothing. move moves one joint by 3 deg at most, each step confirmed at the terminal by a person
who stands at the emergency stop; the arm is enabled before. Without --keep-identity no file has the arm's address, name
or serial number.

  jaka_probe 10.5.5.100 --out my_arm
  jaka_sim --like my_arm/probe.json
  jaka_probe explain my_arm/probe.json
  jaka_probe diff before/probe.json after/probe.json

Exit codes: 0 all was looked for, 1 something could not be (the report says what), 2 wrong usage, 130 ended by Ctrl-C,
129, 131 and 143 by SIGHUP, SIGQUIT and SIGTERM, with a report as with Ctrl-C.
"""
_ENDING = (signal.SIGHUP, signal.SIGQUIT, signal.SIGTERM)


class _Ended(KeyboardInterrupt):
    """A signal that ends the process as Ctrl-C does."""

    def __init__(self, number: int) -> None:
        super().__init__()
        self.number = number


def parser() -> argparse.ArgumentParser:
    """Return the parser of the options."""
    made = argparse.ArgumentParser(
        prog=_NAME, formatter_class=argparse.RawDescriptionHelpFormatter, epilog=_EPILOG,
        description="Find out how a controller differs from what documents say: by a look at its feed, by questions "
        "and, where that is wanted, by values that are set to what they are, and by a few small motions.")
    made.add_argument("address", metavar="ADDRESS", help="of the controller; or explain, or diff")
    made.add_argument("files", nargs="*", metavar="FILE", help="one probe.json to explain, two to compare")
    made.add_argument("--stage", choices=[stage.value for stage in ProbeStage], default=ProbeStage.ASK.value,
                      help="the last stage, default %(default)s")
    made.add_argument("--output", type=_output, metavar="N",
                      help="index, in commands, of a digital output of the cabinet that the stage set switches for 1 "
                      "s: by one count it is output N, by the other N + 1; nothing may happen by either")
    made.add_argument("--program", type=_program, metavar="NAME",
                      help="name of the loaded program, which must only wait, for 10 s or longer: the stage move plays "
                      "it to see whether stop_program ends it")
    made.add_argument("--out", metavar="FOLDER", help="where the files are written: %s" % ", ".join(_FILES))
    made.add_argument("--seconds", type=_seconds, default=_SECONDS, metavar="S",
                      help="how long to listen to the status port, default %(default)g")
    made.add_argument("--keep-identity", action="store_true",
                      help="leave address, name and serial number in the files")
    for port, number in PORT_NUMBERS.items():
        made.add_argument("--%s-port" % port, type=port_number(1), default=number, metavar="N",
                          help="default %d" % number)
    return made


def _seconds(text: str) -> float:
    value = float(text)
    if not 1.0 <= value <= 3600.0:
        raise argparse.ArgumentTypeError("must be from 1 to 3600")
    return value


def _output(text: str) -> int:
    value = int(text)
    if not 1 <= value <= _HIGHEST_OUTPUT:
        raise argparse.ArgumentTypeError("must be from 1 to %d" % _HIGHEST_OUTPUT)
    return value


def _program(text: str) -> str:
    if not 1 <= len(text) <= _LONGEST_NAME:
        raise argparse.ArgumentTypeError("must have 1 to %d characters" % _LONGEST_NAME)
    return text


def main(argv: Optional[List[str]] = None) -> int:
    """Run the command; return an exit code."""
    made = parser()
    options = made.parse_args(argv)
    wanted = {"explain": 1, "diff": 2}.get(options.address, 0)
    if len(options.files) != wanted:
        made.error("%s takes %s" % (options.address, ["no file", "one file", "two files"][wanted]))
    if options.output is not None and options.stage not in (ProbeStage.SET.value, ProbeStage.MOVE.value):
        made.error("--output needs --stage set")
    if options.program is not None and options.stage != ProbeStage.MOVE.value:
        made.error("--program needs --stage move")
    try:
        if options.address == "explain":
            content = report.read(options.files[0])
            _print_identity(content)
            print("\n".join(report.text(report.facts_of(content), report.left_of(content))))
            return 0
        if options.address == "diff":
            one, other = (report.facts_of(report.read(path)) for path in options.files)
            print("\n".join(report.difference(one, other)) or "  no difference")
            return 0
        if not options.out:
            made.error("--out FOLDER is missing")
        return _probe(options)
    except (JakaError, OSError) as error:
        print("%s: error: %s" % (_NAME, error), file=sys.stderr)
        return 1


def _probe(options: argparse.Namespace) -> int:
    folder = Path(options.out)
    folder.mkdir(parents=True, exist_ok=True)
    taken = [name for name in _FILES if (folder / name).exists()]
    if taken:
        raise JakaError("%s has %s already; name another folder" % (folder, taken[0]))
    run, code = _Run(options), 1
    with _ended_by_signals():
        try:
            try:
                code = run.stages()
            except KeyboardInterrupt as ended:
                code = _code_of(ended)
                _tell("ended by %s; what is known by now is written" % _name_of(ended))
            finally:
                with uninterrupted():
                    run.record.close()
                    run.write(folder, code == 0)
        except KeyboardInterrupt as ended:  # while the report was written
            code = _code_of(ended)
    return code


@contextlib.contextmanager
def _ended_by_signals() -> Iterator[None]:
    """Have the signals that end a process raise ``_Ended``: by their default action they would lose the report."""
    def end(number: int, frame: Any) -> None:
        raise _Ended(number)
    with handled_by(end, _ENDING):
        yield


def _code_of(ended: KeyboardInterrupt) -> int:
    return 128 + (ended.number if isinstance(ended, _Ended) else signal.SIGINT)


def _name_of(ended: KeyboardInterrupt) -> str:
    return signal.Signals(ended.number).name if isinstance(ended, _Ended) else "Ctrl-C"


class _Run:
    """One run of the command: the stages in order, and what they leave."""

    def __init__(self, options: argparse.Namespace) -> None:
        self._options = options
        self._last = list(ProbeStage).index(ProbeStage(options.stage))
        self._done: List[ProbeStage] = []
        self._facts: Facts = {}
        self._back = SetBack()
        self._curves: Dict[str, SampledCurve] = {}
        self._person = Person(_NAME)
        self.record = ConnectionLog(options.address)

    def stages(self) -> int:
        """Run the stages up to the last that is wanted; return an exit code."""
        feed = self._look()
        if feed is None or self._last == 0:
            return 0 if feed is not None else self._leave_out(ProbeStage.ASK, self._refusal(feed))
        for stage, run in ((ProbeStage.ASK, self._ask), (ProbeStage.SET, self._set),
                           (ProbeStage.MOVE, self._move))[:self._last]:
            listen([feed], time.monotonic() + _SETTLE_S)
            refusal = self._refusal(feed)
            if refusal:
                return self._leave_out(stage, refusal)
            code = run(feed)
            if code:
                return code
        return 0

    def _look(self) -> Optional[HeardFeed]:
        _tell("look: %.0f s of the status port; nothing is sent" % self._options.seconds)
        self._done.append(ProbeStage.LOOK)
        return look(self.record, self._facts, self._options.status_port, self._options.poll_port,
                    self._options.seconds)

    def _leave_out(self, stage: ProbeStage, reason: str) -> int:
        if self._last:
            _tell("%s: left out, %s" % (stage.value, reason))
        return 1

    def _refusal(self, feed: Optional[HeardFeed]) -> str:
        """Return why the command port is left alone; "" where it may be asked."""
        holder = holder_of(self._options.address, self._options.command_port)
        if holder:
            return "%s has the controller; end it first" % holder
        return unrest([] if feed is None else feed.states, time.monotonic())

    def _ask(self, feed: HeardFeed) -> int:
        _tell("ask: %d questions that read, %d pieces that nobody understands; nothing is set or moved" % (
            len(QUESTIONS), len(ODD)))
        self._done.append(ProbeStage.ASK)
        try:
            ask(self.record, self._facts, self._options.command_port, feed, _tell_part)
        except OSError as error:
            self._facts["reply_time"] = Fact(None, "the command port %d: %s" % (self._options.command_port, error))
            return 1
        return 0

    def _set(self, feed: HeardFeed) -> int:
        output = self._options.output
        _tell("set: these commands, and those that read the same values back; nothing is moved or powered")
        for name, to in SETTINGS.items():
            if name != "set_digital_output" or output is not None:
                _tell_part("%s: %s" % (name, to))
        if output is not None:
            _tell_part("outputs %d and %d of the cabinet, counted from 0: one of them switches for %.0f s" % (
                output - 1, output, HOLD_S))
        _tell_part("frames are written without a name: no command reads it. Ctrl-C waits until a value is set back")
        self._done.append(ProbeStage.SET)
        desk = Desk(self.record, self._options.command_port, feed)
        with self._locked():
            try:
                set_same(desk, self._facts, self._back, output, lambda question: self._person.ask(
                    question, lambda: listen([feed], time.monotonic() + _GLANCE_S)), _tell_part)
            except StageEnded as ended:
                _tell("set: ended, %s" % ended)
                return 1
            finally:
                desk.close()
        return 1 if self._back.left else 0

    def _move(self, feed: HeardFeed) -> int:
        desk = Desk(self.record, self._options.command_port, feed)
        version, table = desk.read("get_version"), desk.read("get_tool_offsets")
        desk.close()
        reason = "" if self._person.is_there else "standard input is no terminal: nobody can confirm its steps"
        reason = reason or why_not(feed.states, frames_of(Query.TOOL_FRAMES, table))
        if reason:
            return self._leave_out(ProbeStage.MOVE, reason)
        name = str((version or {}).get("robot_name") or self._options.address)
        _tell("move: these commands, each step after your consent; a guard process stops the arm where this one ends")
        for command, what in MOVES.items():
            if self._options.program or command not in PROGRAM_MOVES:
                _tell_part("%s: %s" % (command, what))
        _tell_part("no joint goes further than 3 deg; where the tool leaves a sphere of %.0f mm round its start, the "
                   "arm is stopped" % (1000.0 * ROOM_M))
        if self._person.ask("the arm MOVES. Its name is %s; type it to go on: " % name) != name:
            return self._leave_out(ProbeStage.MOVE, "that was not its name")
        listen([feed], time.monotonic() + _SETTLE_S)
        reason = unrest(feed.states, time.monotonic())
        if reason:
            return self._leave_out(ProbeStage.MOVE, reason)
        self._done.append(ProbeStage.MOVE)
        with self._locked():
            guard = Guard(self._options.address, self._options.command_port, self._options.status_port)
            arm = Mover(self.record, self._options.command_port, feed, guard, AXIS, _tell_part, self._back)
            try:
                move(arm, self._facts, self._curves, self._person, _tell_part, self._options.program or "")
            except StageEnded as ended:
                _tell("move: ended, %s" % ended)
                return 1
            except MotionEnded as ended:
                if str(ended) not in self._back.left:
                    self._back.left.append(str(ended))
                return 1
            finally:
                arm.close()
                guard.close()
        return 0

    @contextlib.contextmanager
    def _locked(self) -> Iterator[None]:
        """Let no driver of this computer have the controller."""
        lock = DriverLock(self._options.address, self._options.command_port, _NAME)
        try:
            yield
        finally:
            lock.release()

    def write(self, folder: Path, is_whole: bool) -> None:
        """Write and print the report, and write the log of the wire."""
        if ProbeStage.MOVE in self._done:
            self._facts.update(twin_facts(self._facts, self._curves, ASKED))
        if not self._options.keep_identity:
            self._facts = {name: fact._replace(how=fact.how.replace(self._options.address, "x"))
                           for name, fact in self._facts.items()}
        lines = report.text(self._facts, self._back.left)
        _say("\n".join(["", *lines]))
        (folder / TEXT).write_text("\n".join(lines) + "\n", encoding="utf-8")
        content = report.as_json(self._facts, self._done, is_whole, self._back.left, self._curves)
        (folder / REPORT).write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
        (folder / PAGE).write_text(page(content, self._facts), encoding="utf-8")
        (folder / DIALECT).write_text(json.dumps(report.dialect_of(self._facts), indent=1) + "\n", encoding="utf-8")
        self.record.write(str(folder / WIRE), self._options.keep_identity)
        left_out = "; the last %d bytes that came are not in %s" % (
            self.record.left_out, WIRE) if self.record.left_out else ""
        _tell("written to %s: %s%s" % (folder, ", ".join(_FILES), left_out))
        if not self._options.keep_identity:
            _print_identity(content)
        if report.firmware_of(self._facts):
            _tell("a simulated controller like it: jaka_sim --like %s" % (folder / REPORT))


def _print_identity(content: Dict[str, Any]) -> None:
    for line in identity_in(content):
        _tell("look at this before you send it to somebody: %s" % line)


def _tell(line: str) -> None:
    _say("%s: %s" % (_NAME, line))


def _say(text: str) -> None:
    """Print; a terminal that has gone keeps no arm from being stopped, and no report from being written."""
    with contextlib.suppress(OSError):
        print(text, flush=True)


def _tell_part(line: str) -> None:
    _tell("     " + line)
