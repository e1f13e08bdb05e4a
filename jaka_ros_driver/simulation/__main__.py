"""Command line: ``jaka_sim`` serves a simulated controller.

``jaka_sim panel ACTION key=value`` sends a request to the operator port of a running one.
"""
import argparse
import json
import sys
from typing import Any, Dict, List, Optional

from jaka_ros_driver.errors import JakaError
from jaka_ros_driver.kinematics.arm_models import file_or_none, model_names
from jaka_ros_driver.protocol.ports import PORT_NUMBERS
from jaka_ros_driver.simulation.arm.servo import Starvation
from jaka_ros_driver.simulation.controller.beginning import Beginning
from jaka_ros_driver.simulation.controller.firmware import FIRMWARES
from jaka_ros_driver.simulation.dialect.like import like_controller
from jaka_ros_driver.simulation.dialect.table import Dialect
from jaka_ros_driver.simulation.server.event_loop import ask_operator_port
from jaka_ros_driver.simulation.server.operator_actions import ACTIONS
from jaka_ros_driver.simulation.simulated_controller import SINGLE_CLIENT, SimulatedController
from jaka_ros_driver.units import deg_to_rad, s_to_ms
from jaka_ros_driver.wire import proxy
from jaka_ros_driver.wire.sockets import LOOPBACK
from jaka_ros_driver.wire.startup import port_number, print_ports, raise_priority, stop_on_signals

_MODEL, _FIRMWARE = "zu7", "1.5.14"
"""Model and firmware where nothing tells others."""


def main(argv: Optional[List[str]] = None) -> int:
    """Run the command line; return 0 when done, 1 when it failed, 2 for wrong usage.

    argv: Without the command's name; None for those of the process, without what roslaunch adds (__name:=...).
    """
    arguments = [word for word in sys.argv[1:] if ":=" not in word] if argv is None else argv
    if arguments[:1] == ["panel"]:
        return _operate(arguments[1:])
    return proxy.main(arguments[1:]) if arguments[:1] == ["proxy"] else _serve(arguments)


def _serve(arguments: List[str]) -> int:
    options = _serving_parser().parse_args(arguments)
    settings = vars(options)
    if settings["operator_port"] < 0:
        settings["operator_port"] = None
    raise_priority(settings.pop("realtime"))
    if options.host not in (LOOPBACK, "localhost"):
        print("jaka_sim: warning: listening on %s: everybody who reaches this address can drive the simulated arm"
              % options.host, file=sys.stderr)
    try:
        settings.update(_as_told(settings.pop("like"), options.dialect, settings.pop("dialect_seed"), options))
        del settings["reply_delay"]
        path = settings.pop("begin_with")
        arm = SimulatedController(**settings, beginning=Beginning.from_file(path) if path else None)
        stop_on_signals(arm.stop)
        print_ports({**arm.server.port_numbers, "panel": arm.operator_port})
        arm.run()
    except (JakaError, OSError) as error:
        print("jaka_sim: error: %s" % error, file=sys.stderr)
        return 1
    return 0


def _as_told(like: Optional[str], path: Optional[str], seed: Optional[int],
             options: argparse.Namespace) -> Dict[str, Any]:
    """Return firmware, model, dialect, delays and deceleration, of a report where there is one."""
    delay = options.reply_delay
    if like is None:
        firmware = options.firmware or _FIRMWARE
        return {"firmware": firmware, "model": options.model or _MODEL, "dialect": _dialect(path, seed, firmware),
                "reply_delays": (delay or 0.0,) * 2}
    found = like_controller(like, options.firmware)
    model, rate = options.model or found.model or _MODEL, found.stop_deceleration
    delays = found.reply_delays if delay is None else (delay,) * 2
    print("jaka_sim: like %s: firmware %s, model %s, stops at %s, answers after %.1f ms, one of 50 after %.1f ms, "
          "dialect %s" % (like, found.firmware, model, "the model's deceleration" if rate is None else
                          "%.1f deg/s2" % rate, s_to_ms(delays[0]), s_to_ms(delays[1]),
                          json.dumps(found.dialect.as_dict())), file=sys.stderr)
    return {"firmware": found.firmware, "model": model, "dialect": found.dialect,
            "reply_delays": delays, "stop_deceleration": None if rate is None else deg_to_rad(rate)}


def _dialect(path: Optional[str], seed: Optional[int], firmware: str) -> Dialect:
    """Return the dialect that was asked for; print it on stderr where it is not the firmware's default."""
    if path is not None:
        dialect = Dialect.from_file(path, firmware)
    elif seed is not None:
        dialect = Dialect.from_seed(seed, firmware)
    else:
        return Dialect.default(firmware)
    print("jaka_sim: dialect %s" % json.dumps(dialect.as_dict()), file=sys.stderr)
    return dialect


def _serving_parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="jaka_sim", description="A simulated JAKA controller. Its first line of output is JSON with the numbers "
        "of its ports. 'jaka_sim panel --help' describes the operator port, 'jaka_sim proxy --help' the "
        "recording of a real controller.")
    parser.add_argument("--model", metavar="NAME", help="one of %s; default %s, or the one of --like" % (
        ", ".join(model_names()), _MODEL))
    parser.add_argument("--dh-file", metavar="FILE", type=file_or_none,
                        help="a model of your own instead, see docs/simulation.md; none: no file")
    parser.add_argument("--host", default=LOOPBACK, metavar="ADDRESS", help="where to listen; default loopback only")
    for port, default, text in (
            ("command", PORT_NUMBERS["command"], "commands"), ("status", PORT_NUMBERS["status"], "status feed"),
            ("poll", PORT_NUMBERS["poll"], "polled status"), ("panel", 0, "operator port, -1 for none")):
        parser.add_argument("--%s-port" % port, type=port_number(-1 if port == "panel" else 0), default=default,
                            dest="%s_port" % ("operator" if port == "panel" else port),
                            metavar="N", help="%s; 0 for a free port, default %d" % (text, default))
    parser.add_argument("--time-scale", type=float, default=1.0, metavar="FACTOR",
                        help="simulated seconds a wall second, default 1")
    parser.add_argument("--firmware", choices=list(FIRMWARES),
                        help="generation, default %s, or the one of --like" % _FIRMWARE)
    which = parser.add_mutually_exclusive_group()
    which.add_argument("--dialect", metavar="FILE", help="YAML or JSON: what it does on points that are open; see "
                       "docs/simulation.md. Default: the likeliest of the firmware")
    which.add_argument("--dialect-seed", type=int, metavar="N", help="draw every one of these points, and print them")
    which.add_argument("--like", metavar="FILE", help="a probe.json of jaka_probe: a controller like the one that it "
                       "was made of, with its firmware, model and dialect; see docs/first_contact.md")
    parser.add_argument("--io-index-base", type=int, choices=[0, 1], help="index of the first terminal in commands "
                        "about inputs and outputs, instead of the dialect's")
    parser.add_argument("--force-sensor", action="store_true", help="a force and torque sensor at the flange, which "
                        "the operator port loads with a wrench; default none")
    parser.add_argument("--single-client", choices=list(SINGLE_CLIENT), help="a second command client replaces the "
                        "first, is refused, or is served beside it, instead of the dialect's")
    parser.add_argument("--starvation", choices=[s.value for s in Starvation], help="a servo stream that runs dry: "
                        "hold, repeat the last increment, coast to rest, fail; instead of the dialect's")
    parser.add_argument("--start", default="off", choices=["off", "powered", "enabled"], help="default off")
    parser.add_argument("--begin-with", metavar="FILE", help="YAML or JSON: joints, tool, user frame, payload, "
                        "collision level, speed override and terminals at the start; see docs/simulation.md")
    parser.add_argument("--power-delay", type=float, metavar="S", help="simulated s, instead of the dialect's")
    parser.add_argument("--enable-delay", type=float, metavar="S", help="simulated s, instead of the dialect's")
    parser.add_argument("--reply-delay", type=float, metavar="S", help="how much later than at once each reply comes, "
                        "simulated s; default 0, or as late as those of --like")
    parser.add_argument("--seed", type=int, default=0, metavar="N", help="of the wire faults, default 0")
    parser.add_argument("--identity", metavar="TOKEN",
                        help="what it answers to get_simulator_identity, default one that no other has")
    parser.add_argument("--realtime", action="store_true",
                        help="real-time priority (SCHED_FIFO) instead of nice -10; both need the right to")
    parser.add_argument("--log", metavar="FILE.mcap", help="log every byte in and out; needs the package mcap")
    return parser


def _operate(arguments: List[str]) -> int:
    actions = "\n".join("  %-22s %s%s" % (name, action.meaning, "\n%25s%s" % ("", action.parameters)
                                          if action.parameters else "") for name, action in ACTIONS.items())
    parser = argparse.ArgumentParser(
        prog="jaka_sim panel", formatter_class=argparse.RawDescriptionHelpFormatter, epilog="actions:\n" + actions,
        description="Send a request to the operator port of a running simulated controller; prints the answer, JSON.")
    parser.add_argument("--port", type=port_number(1), required=True, metavar="N",
                        help="the operator port, from the first line of the simulated controller")
    parser.add_argument("action", metavar="ACTION", choices=list(ACTIONS))
    parser.add_argument("parameters", nargs="*", metavar="key=value", help="value is JSON, or text")
    options = parser.parse_args(arguments)
    request: Dict[str, Any] = {"action": options.action}
    for parameter in options.parameters:
        key, equals, text = parameter.partition("=")
        if not equals:
            parser.error("%r is no key=value" % parameter)
        request[key] = _value(text)
    try:
        answer = ask_operator_port(options.port, request)
    except JakaError as error:
        print("jaka_sim: error: %s" % error, file=sys.stderr)
        return 1
    if not answer.get("ok"):
        print("jaka_sim: error: %s" % answer.get("error"), file=sys.stderr)
        return 1
    print(json.dumps({key: value for key, value in answer.items() if key != "ok"}))
    return 0


def _value(text: str) -> Any:
    try:
        return json.loads(text)
    except ValueError:
        return text


if __name__ == "__main__":
    sys.exit(main())
