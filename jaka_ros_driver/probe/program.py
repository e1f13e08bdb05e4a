"""The command jaka_probe: its options, the stages in order, and what it leaves."""
import argparse
import json
import sys
from pathlib import Path
from typing import List, Optional

from jaka_ros_driver.errors import JakaError
from jaka_ros_driver.probe import report
from jaka_ros_driver.probe.ask import ODD, QUESTIONS, ask
from jaka_ros_driver.probe.facts import Fact, Facts, ProbeStage
from jaka_ros_driver.probe.look import HeardFeed, look
from jaka_ros_driver.probe.recorded import ConnectionLog
from jaka_ros_driver.protocol.ports import PORT_NUMBERS
from jaka_ros_driver.ros.driver_lock import holder_of
from jaka_ros_driver.state import unrest

_NAME = "jaka_probe"
_SECONDS = 30.0
REPORT, TEXT, DIALECT, WIRE = "probe.json", "probe.txt", "dialect.json", "wire.mcap"
_FILES = (REPORT, TEXT, DIALECT, WIRE)
_EPILOG = """\
Stages: look sends nothing; it reads the status port. ask, the default, goes on to read values on the command port.
Neither sets, moves or powers anything. Without --keep-identity no file has the arm's address, name or serial number.

  jaka_probe 10.5.5.100 --out my_arm
  jaka_sim --dialect my_arm/dialect.json
  jaka_probe explain my_arm/probe.json
  jaka_probe diff before/probe.json after/probe.json

Exit codes: 0 all was looked for, 1 something could not be (the report says what), 2 wrong usage, 130 ended by Ctrl-C.
"""


def parser() -> argparse.ArgumentParser:
    """Return the parser of the options."""
    made = argparse.ArgumentParser(
        prog=_NAME, formatter_class=argparse.RawDescriptionHelpFormatter, epilog=_EPILOG,
        description="Find out how a controller differs from what documents say, without moving or setting anything.")
    made.add_argument("address", metavar="ADDRESS", help="of the controller; or explain, or diff")
    made.add_argument("files", nargs="*", metavar="FILE", help="one probe.json to explain, two to compare")
    made.add_argument("--stage", choices=[stage.value for stage in ProbeStage], default=ProbeStage.ASK.value,
                      help="the last stage, default %(default)s")
    made.add_argument("--out", metavar="FOLDER", help="where the files are written: %s" % ", ".join(_FILES))
    made.add_argument("--seconds", type=_seconds, default=_SECONDS, metavar="S",
                      help="how long to listen to the status port, default %(default)g")
    made.add_argument("--keep-identity", action="store_true",
                      help="leave address, name and serial number in the files")
    for port, number in PORT_NUMBERS.items():
        made.add_argument("--%s-port" % port, type=_port, default=number, metavar="N", help="default %d" % number)
    return made


def _seconds(text: str) -> float:
    value = float(text)
    if not 1.0 <= value <= 3600.0:
        raise argparse.ArgumentTypeError("must be from 1 to 3600")
    return value


def _port(text: str) -> int:
    value = int(text)
    if not 0 < value < 65536:
        raise argparse.ArgumentTypeError("must be from 1 to 65535")
    return value


def main(argv: Optional[List[str]] = None) -> int:
    """Run the command; return an exit code."""
    made = parser()
    options = made.parse_args(argv)
    wanted = {"explain": 1, "diff": 2}.get(options.address, 0)
    if len(options.files) != wanted:
        made.error("%s takes %s" % (options.address, ["no file", "one file", "two files"][wanted]))
    try:
        if options.address == "explain":
            print("\n".join(report.text(report.facts_of(report.read(options.files[0])))))
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
    record, code = ConnectionLog(options.address), 1
    facts: Facts = {}
    done: List[ProbeStage] = []
    try:
        code = _run(options, record, facts, done)
    except KeyboardInterrupt:
        _tell("ended by Ctrl-C; what is known by now is written")
        code = 130
    finally:
        record.close()
        _write(folder, options, record, facts, done, code == 0)
    return code


def _run(options: argparse.Namespace, record: ConnectionLog, facts: Facts, done: List[ProbeStage]) -> int:
    _tell("look: %.0f s of the status port; nothing is sent" % options.seconds)
    done.append(ProbeStage.LOOK)
    feed = look(record, facts, options.status_port, options.poll_port, options.seconds)
    if options.stage == ProbeStage.LOOK.value:
        return 0 if feed is not None else 1
    refusal = _refusal(options, feed)
    if refusal:
        _tell("ask: left out, %s" % refusal)
        return 1
    _tell("ask: %d questions that read, %d pieces that nobody understands; nothing is set or moved" % (
        len(QUESTIONS), len(ODD)))
    done.append(ProbeStage.ASK)
    try:
        ask(record, facts, options.command_port, feed, lambda line: _tell("     " + line))
    except OSError as error:
        facts["reply_time"] = Fact(None, "the command port %d: %s" % (options.command_port, error))
        return 1
    return 0


def _refusal(options: argparse.Namespace, feed: Optional[HeardFeed]) -> str:
    """Return why the command port is left alone; "" where it may be asked."""
    holder = holder_of(options.address, options.command_port)
    if holder:
        return "%s has the controller; end it first" % holder
    return unrest([] if feed is None else feed.states)


def _write(folder: Path, options: argparse.Namespace, record: ConnectionLog, facts: Facts, done: List[ProbeStage],
           is_whole: bool) -> None:
    lines = report.text(facts)
    print("\n".join(["", *lines]), flush=True)
    (folder / TEXT).write_text("\n".join(lines) + "\n", encoding="utf-8")
    content = json.dumps(report.as_json(facts, done, is_whole), indent=1)
    (folder / REPORT).write_text(content + "\n", encoding="utf-8")
    (folder / DIALECT).write_text(json.dumps(report.dialect_of(facts), indent=1) + "\n", encoding="utf-8")
    record.write(str(folder / WIRE), options.keep_identity)
    left_out = "; the last %d bytes that came are not in %s" % (record.left_out, WIRE) if record.left_out else ""
    _tell("written to %s: %s%s" % (folder, ", ".join(_FILES), left_out))
    firmware, models = report.firmware_of(facts), facts.get("model", Fact(None, "")).value
    if firmware:
        _tell("a simulated controller like it: jaka_sim --firmware %s%s --dialect %s" % (
            firmware, " --model %s" % models[0] if models else "", folder / DIALECT))


def _tell(line: str) -> None:
    print("%s: %s" % (_NAME, line), flush=True)
