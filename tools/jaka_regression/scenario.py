"""The scenario of a golden log: the arms, their simulated controllers, and what the operator does.

It stands in a YAML file beside the log, ``golden.yaml`` for ``golden.mcap``; without one there is one arm, with the
parameters that the log's recording found set.
"""
import enum
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Dict, List, Mapping, NamedTuple, Tuple

import yaml

from jaka_bag.compare.tolerances import Tolerances, check_names, parse_tolerances
from jaka_bag.containers.registry import open_log
from jaka_bag.driver_interface import PARAMETERS_NAME
from jaka_bag.errors import BagError
from jaka_bag.paths import PathLike
from jaka_bag.yaml_text import load_yaml

BANKS = ("cabinet", "tool", "extension")
"""Places of terminals, as ``jaka_msgs/IOStates`` and the operator port name them."""
IO_TOPIC = "io_states"
"""Name of the topic that tells of them, below the driver's node."""
DEFAULT_SIMULATION = ("--start", "enabled")
_NOT_PASSED_ON = ("ip", "command_port", "status_port", "simulator")


class ScenarioError(BagError):
    """A scenario file that is not understood; the text names the file and the key."""


@dataclass(frozen=True)
class ArmSetup:
    """One arm.

    Attributes:
        namespace: Namespace of its driver, as ``/left``; empty for the root.
        model: Model of its simulated controller and of its driver.
        simulation: Arguments of its simulated controller.
        parameters: Private parameters of its driver.
        state: What its simulated controller begins with, as ``jaka_sim --begin-with`` has it; the rest is the log's.
    """

    namespace: str = ""
    model: str = "zu7"
    simulation: Tuple[str, ...] = DEFAULT_SIMULATION
    parameters: Tuple[Tuple[str, Any], ...] = ()
    state: Tuple[Tuple[str, Any], ...] = ()


class CauseKind(enum.Enum):
    """The kinds of causes that an event of a scenario comes after."""

    BEGIN = "begin"
    CALL = "after_call"
    ANSWER = "after_answer"
    MOTION = "after_motion"
    OUTPUT = "after_output"
    INPUT = "after_input"


class EventCause(NamedTuple):
    """The cause that an event of a scenario comes after.

    Attributes:
        kind: BEGIN: the beginning of the run. CALL: a recorded call is made again. ANSWER: a service of the arm's
            driver has answered. MOTION: the arm begins to move. OUTPUT, INPUT: a digital terminal has changed.
        arm: Namespace; empty for BEGIN and CALL.
        what: ANSWER: (service below the driver's node,). OUTPUT, INPUT: (bank, index, 0 or 1). Else empty.
        nth: Number from 0: of the call in the log, of the answers of this service, of the arm's motions, of the changes
            of this terminal to this value.
    """

    kind: CauseKind
    arm: str = ""
    what: Tuple[Any, ...] = ()
    nth: int = 0


BEGIN = EventCause(CauseKind.BEGIN)
_CAUSE_KEYS = tuple(kind.value for kind in CauseKind if kind is not CauseKind.BEGIN)


class ControllerEvent(NamedTuple):
    """Something that happens at the simulated controller.

    Attributes:
        arm: Namespace.
        after: What it comes after.
        delay_s: Time after that, s of the golden log.
        request: Request to the simulated controller's operator port.
    """

    arm: str
    after: EventCause
    delay_s: float
    request: Mapping[str, Any]


@dataclass(frozen=True)
class Scenario:
    """The scenario that a golden log needs to be replayed.

    Attributes:
        about: Account of how the log was made.
        licence: Licence of the log.
        arms: Arms, at least one.
        events: Events in the order of the file.
        tolerances: Tolerances that differ from the defaults.
        has_events: The file tells the events, be it that there are none.
    """

    about: str = ""
    licence: str = ""
    arms: Tuple[ArmSetup, ...] = (ArmSetup(),)
    events: Tuple[ControllerEvent, ...] = ()
    tolerances: Tolerances = Tolerances()
    has_events: bool = False


def _mapping(where: str, value: Any) -> Dict[str, Any]:
    if not isinstance(value, dict):
        raise ScenarioError("%s: expected keys with values, not %r" % (where, value))
    return value


def _checked(where: str, value: Any, known: Tuple[str, ...]) -> Dict[str, Any]:
    given = _mapping(where, value)
    check_names(where, given, known, ScenarioError)
    return given


def _typed(where: str, value: Any, kind: Any, words: str) -> Any:
    if not isinstance(value, kind) or isinstance(value, bool):
        raise ScenarioError("%s: expected %s, not %r" % (where, words, value))
    return value


def _arm(where: str, value: Any) -> ArmSetup:
    given = _checked(where, value, ("namespace", "model", "simulation", "parameters", "state"))
    namespace = _typed(where + ".namespace", given.get("namespace", ""), str, "a text").rstrip("/")
    if namespace and not namespace.startswith("/"):
        raise ScenarioError("%s.namespace: %r does not begin with /" % (where, namespace))
    words = _typed(where + ".simulation", given.get("simulation", list(DEFAULT_SIMULATION)), list, "a list")
    for word in words:
        if isinstance(word, bool) or not isinstance(word, (str, int, float)):
            raise ScenarioError("%s.simulation: %r is no word of a command line; YAML takes on, off, yes and no for "
                                "true and false: put them in quotes" % (where, word))
    parameters = _mapping(where + ".parameters", given.get("parameters", {}))
    state = _mapping(where + ".state", given.get("state", {}))
    return ArmSetup(namespace, _typed(where + ".model", given.get("model", "zu7"), str, "a text"),
               tuple(str(word) for word in words), tuple(parameters.items()), tuple(state.items()))


def _number(where: str, value: Any, words: str) -> int:
    number: int = _typed(where, value, int, words)
    if number < 0:
        raise ScenarioError("%s: negative numbers make no sense here" % where)
    return number


def _cause(where: str, value: Mapping[str, Any], arm: str) -> EventCause:
    """Parse what an event comes after: one of the keys ``after_...``, or none for the beginning."""
    given = [kind for kind in CauseKind if kind is not CauseKind.BEGIN and value.get(kind.value) is not None]
    if len(given) > 1:
        raise ScenarioError("%s: one of %s, not several" % (where, ", ".join(kind.value for kind in given)))
    if not given:
        return BEGIN
    kind, place = given[0], "%s.%s" % (where, given[0].value)
    told = value[kind.value]
    if kind is CauseKind.CALL:
        return EventCause(kind, "", (), _number(place, told, "the number of a call"))
    if kind is CauseKind.MOTION:
        return EventCause(kind, arm, (), _number(place, told, "the number of a motion"))
    if kind is CauseKind.ANSWER:
        named = _checked(place, told, ("service", "nth"))
        service = _typed(place + ".service", named.get("service"), str, "a service below the driver")
        return EventCause(kind, arm, (service,), _number(place + ".nth", named.get("nth", 0), "a number"))
    terminal = _checked(place, told, ("bank", "index", "value", "nth"))
    bank = terminal.get("bank", BANKS[0])
    if bank not in BANKS:
        raise ScenarioError("%s.bank: %r is none of %s" % (place, bank, ", ".join(BANKS)))
    level = terminal.get("value", 1)
    if level not in (0, 1):
        raise ScenarioError("%s.value: 0 or 1, not %r" % (place, level))
    index = _number(place + ".index", terminal.get("index"), "the number of a terminal")
    return EventCause(kind, arm, (bank, index, int(level)), _number(place + ".nth", terminal.get("nth", 0), "a number"))


def _event(where: str, value: Any, arms: Tuple[ArmSetup, ...]) -> ControllerEvent:
    if not isinstance(value, dict) or not isinstance(value.get("action"), str):
        raise ScenarioError("%s: expected keys with values, action among them, not %r" % (where, value))
    wrong = sorted(str(key) for key in value if str(key).startswith("after") and key not in _CAUSE_KEYS)
    if wrong:
        check_names(where, {wrong[0]: None}, _CAUSE_KEYS, ScenarioError)
    request = {key: item for key, item in value.items() if key not in ("arm", "delay_s", *_CAUSE_KEYS)}
    arm = value.get("arm", arms[0].namespace)
    if arm not in [known.namespace for known in arms]:
        raise ScenarioError("%s.arm: there is no arm %r" % (where, arm))
    delay = _typed(where + ".delay_s", value.get("delay_s", 0.0), (int, float), "a number of seconds")
    if delay < 0:
        raise ScenarioError("%s: negative numbers make no sense here" % where)
    return ControllerEvent(arm, _cause(where, value, arm), float(delay), request)


def parse_scenario(text: str, name: str, known_arms: Tuple[ArmSetup, ...] = (ArmSetup(),)) -> Scenario:
    """Parse a scenario from YAML text.

    Args:
        text: The YAML.
        name: Name of the file, for errors.
        known_arms: The arms where the text tells none.

    Raises:
        ScenarioError: Not YAML, an unknown key, a value of the wrong type.
        ToleranceError: The tolerances in it are not understood.
    """
    try:
        document = load_yaml(text)
    except (yaml.YAMLError, ValueError) as error:  # a date that is none raises ValueError
        raise ScenarioError("%s: %s" % (name, " ".join(str(error).split()))) from error
    given = _checked(name, {} if document is None else document,
                     ("about", "licence", "arms", "events", "tolerances"))
    arms = known_arms
    if "arms" in given:
        entries = _typed(name + ": arms", given["arms"], list, "a list")
        arms = tuple(_arm("%s: arms[%d]" % (name, i), entry) for i, entry in enumerate(entries))
    if not arms or len({arm.namespace for arm in arms}) != len(arms):
        raise ScenarioError("%s: arms: at least one, each with a namespace of its own" % name)
    happenings = _typed(name + ": events", given.get("events", []), list, "a list")
    events = tuple(_event("%s: events[%d]" % (name, i), entry, arms) for i, entry in enumerate(happenings))
    tolerances = parse_tolerances(yaml.safe_dump(given["tolerances"]), name + ": tolerances") \
        if given.get("tolerances") else Tolerances()
    return Scenario(_typed(name + ": about", given.get("about", ""), str, "a text"),
                    _typed(name + ": licence", given.get("licence", ""), str, "a text"), arms, events, tolerances,
                    "events" in given)


def _arms_of_log(path: PathLike) -> Tuple[ArmSetup, ...]:
    """Return the arms that a log shows, each with the parameters that the recorder found on the parameter server."""
    with open_log(path) as reader:
        topics = {connection.topic for connection in reader.connections}
        found = [reader.read_attachment(entry) for entry in reader.index.attachments if entry.name == PARAMETERS_NAME]
    try:
        parameters = load_yaml(found[-1]) if found else {}
    except (yaml.YAMLError, ValueError):
        parameters = {}
    arms: List[ArmSetup] = []
    for node in sorted(topic.rsplit("/", 1)[0] for topic in topics if topic.endswith("/joint_position")):
        inner: Any = parameters
        for word in node.strip("/").split("/"):
            inner = inner.get(word) if isinstance(inner, dict) else None
        known = {key: value for key, value in inner.items() if key not in _NOT_PASSED_ON and value != ""} \
            if isinstance(inner, dict) else {}
        arms.append(ArmSetup(node.rsplit("/", 1)[0], str(known.pop("model", "zu7")), parameters=tuple(known.items())))
    return tuple(arms) or (ArmSetup(),)


def scenario_of(log: PathLike) -> Scenario:
    """Load the scenario of a golden log: from the file beside it, else from the log itself.

    Raises:
        ScenarioError: The file is not understood.
        ToleranceError: The tolerances in it are not understood.
        BagError: The log cannot be read.
    """
    beside = Path(str(log)).with_suffix(".yaml")
    if not beside.exists():
        return Scenario(arms=_arms_of_log(log))
    try:
        text = beside.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise ScenarioError("cannot read %s: %s" % (beside, error)) from error
    return parse_scenario(text, str(beside), _arms_of_log(log))
