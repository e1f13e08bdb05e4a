"""The scenario of a golden log: the arms, their simulated controllers, and what the operator does.

It stands in a YAML file beside the log, ``golden.yaml`` for ``golden.mcap``; without one there is one arm, with the
parameters that the log's recording found set.
"""
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Dict, List, Mapping, NamedTuple, Optional, Tuple

import yaml

from jaka_bag.compare.tolerances import Tolerances, check_names, parse_tolerances
from jaka_bag.containers.registry import open_log
from jaka_bag.errors import BagError
from jaka_bag.paths import PathLike

DEFAULT_SIMULATION = ("--start", "enabled")
_NOT_PASSED_ON = ("ip", "command_port", "status_port", "simulator")
_PARAMETERS_NAME = "rosparam.yaml"


class ScenarioError(BagError):
    """A scenario file that is not understood; the text names the file and the key."""


@dataclass(frozen=True)
class Arm:
    """One arm.

    Attributes:
        namespace: Namespace of its driver, as ``/left``; empty for the root.
        model: Model of its simulated controller and of its driver.
        simulation: Arguments of its simulated controller.
        parameters: Private parameters of its driver.
    """

    namespace: str = ""
    model: str = "zu7"
    simulation: Tuple[str, ...] = DEFAULT_SIMULATION
    parameters: Tuple[Tuple[str, Any], ...] = ()


class Event(NamedTuple):
    """Something that happens at the simulated controller.

    Attributes:
        arm: Namespace.
        after_call: Number of the call, from 0, that it comes after the start of; None: after the replay's beginning.
        delay_s: Time after that, s of the golden log.
        request: Request to the simulated controller's operator port.
    """

    arm: str
    after_call: Optional[int]
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
    """

    about: str = ""
    licence: str = ""
    arms: Tuple[Arm, ...] = (Arm(),)
    events: Tuple[Event, ...] = ()
    tolerances: Tolerances = Tolerances()


def _checked(where: str, value: Any, known: Tuple[str, ...]) -> Dict[str, Any]:
    if not isinstance(value, dict):
        raise ScenarioError("%s: expected keys with values, not %r" % (where, value))
    check_names(where, value, known, ScenarioError)
    return value


def _typed(where: str, value: Any, kind: Any, words: str) -> Any:
    if not isinstance(value, kind) or isinstance(value, bool):
        raise ScenarioError("%s: expected %s, not %r" % (where, words, value))
    return value


def _arm(where: str, value: Any) -> Arm:
    given = _checked(where, value, ("namespace", "model", "simulation", "parameters"))
    namespace = _typed(where + ".namespace", given.get("namespace", ""), str, "a text").rstrip("/")
    if namespace and not namespace.startswith("/"):
        raise ScenarioError("%s.namespace: %r does not begin with /" % (where, namespace))
    words = _typed(where + ".simulation", given.get("simulation", list(DEFAULT_SIMULATION)), list, "a list")
    for word in words:
        if isinstance(word, bool) or not isinstance(word, (str, int, float)):
            raise ScenarioError("%s.simulation: %r is no word of a command line; YAML takes on, off, yes and no for "
                                "true and false: put them in quotes" % (where, word))
    parameters = _checked(where + ".parameters", given.get("parameters", {}), tuple(given.get("parameters", {}) or ()))
    return Arm(namespace, _typed(where + ".model", given.get("model", "zu7"), str, "a text"),
               tuple(str(word) for word in words), tuple(parameters.items()))


def _event(where: str, value: Any, arms: Tuple[Arm, ...]) -> Event:
    if not isinstance(value, dict) or not isinstance(value.get("action"), str):
        raise ScenarioError("%s: expected keys with values, action among them, not %r" % (where, value))
    request = {key: item for key, item in value.items() if key not in ("arm", "after_call", "delay_s")}
    arm = value.get("arm", arms[0].namespace)
    if arm not in [known.namespace for known in arms]:
        raise ScenarioError("%s.arm: there is no arm %r" % (where, arm))
    after = value.get("after_call")
    if after is not None:
        _typed(where + ".after_call", after, int, "the number of a call")
    delay = _typed(where + ".delay_s", value.get("delay_s", 0.0), (int, float), "a number of seconds")
    if delay < 0 or (after is not None and after < 0):
        raise ScenarioError("%s: negative numbers make no sense here" % where)
    return Event(arm, after, float(delay), request)


def parse_scenario(text: str, name: str) -> Scenario:
    """Parse a scenario from YAML text.

    Raises:
        ScenarioError: Not YAML, an unknown key, a value of the wrong type.
        ToleranceError: The tolerances in it are not understood.
    """
    try:
        document = yaml.safe_load(text)
    except yaml.YAMLError as error:
        raise ScenarioError("%s: %s" % (name, " ".join(str(error).split()))) from error
    given = _checked(name, {} if document is None else document,
                     ("about", "licence", "arms", "events", "tolerances"))
    entries = _typed(name + ": arms", given.get("arms", [{}]), list, "a list")
    arms = tuple(_arm("%s: arms[%d]" % (name, i), entry) for i, entry in enumerate(entries))
    if not arms or len({arm.namespace for arm in arms}) != len(arms):
        raise ScenarioError("%s: arms: at least one, each with a namespace of its own" % name)
    happenings = _typed(name + ": events", given.get("events", []), list, "a list")
    events = tuple(_event("%s: events[%d]" % (name, i), entry, arms) for i, entry in enumerate(happenings))
    tolerances = parse_tolerances(yaml.safe_dump(given["tolerances"]), name + ": tolerances") \
        if given.get("tolerances") else Tolerances()
    return Scenario(_typed(name + ": about", given.get("about", ""), str, "a text"),
                    _typed(name + ": licence", given.get("licence", ""), str, "a text"), arms, events, tolerances)


def _arms_of_log(path: PathLike) -> Tuple[Arm, ...]:
    """Return the arms that a log shows, each with the parameters that the recorder found on the parameter server."""
    with open_log(path) as reader:
        topics = {connection.topic for connection in reader.connections}
        found = [reader.read_attachment(entry) for entry in reader.index.attachments if entry.name == _PARAMETERS_NAME]
    try:
        parameters = yaml.safe_load(found[0]) if found else {}
    except yaml.YAMLError:
        parameters = {}
    arms: List[Arm] = []
    for node in sorted(topic.rsplit("/", 1)[0] for topic in topics if topic.endswith("/joint_position")):
        inner: Any = parameters
        for word in node.strip("/").split("/"):
            inner = inner.get(word) if isinstance(inner, dict) else None
        known = {key: value for key, value in inner.items() if key not in _NOT_PASSED_ON and value != ""} \
            if isinstance(inner, dict) else {}
        arms.append(Arm(node.rsplit("/", 1)[0], str(known.pop("model", "zu7")), parameters=tuple(known.items())))
    return tuple(arms) or (Arm(),)


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
    return parse_scenario(text, str(beside))
