"""The limits of an arm from its URDF: the driver's ``robot_description``, running or in the log, or a file."""
import math
from typing import Any, List, NamedTuple, Optional, Sequence
from xml.etree import ElementTree

import numpy as np
import yaml

from jaka_bag.containers.registry import open_log
from jaka_bag.driver_interface import JOINT_ACCELERATION_CEILING, JOINT_SPEED_CEILING, PARAMETERS_NAME
from jaka_bag.errors import BagError
from jaka_bag.json_text import load_json
from jaka_bag.messages.batch import Array
from jaka_bag.paths import PathLike
from jaka_bag.yaml_text import load_yaml

DESCRIPTION = "robot_description"
_MAKER = "jaka"


class UnknownLimits(BagError):
    """The text tells no limits for the joints of a log."""


class ArmLimits(NamedTuple):
    """The limits of an arm's joints.

    Attributes:
        model: Name of the arm, as the URDF has it.
        low: Smallest positions, rad (6,).
        high: Largest positions, rad (6,).
        speed: Largest speeds, rad/s (6,).
        acceleration: Largest accelerations, rad/s2 (6,).
    """

    model: str
    low: Array
    high: Array
    speed: Array
    acceleration: Array


def limits_from_urdf(text: str, names: Sequence[str]) -> ArmLimits:
    """Read the limits of joints, by their names without a prefix; those of the URDF may have one.

    A URDF has no accelerations: the driver's bound stands for them. Nor does a joint get more speed than the driver
    allows.

    Raises:
        UnknownLimits: It is no URDF, or lacks a joint or its limits.
    """
    try:
        robot = ElementTree.fromstring(text)
    except ElementTree.ParseError as error:
        raise UnknownLimits("the robot description is no XML: %s" % error) from error
    joints = {joint.get("name", ""): joint.find("limit") for joint in robot.iter("joint")}
    found = [_joint_of(name, list(joints)) for name in names]
    rows = np.array([_numbers(name, joints[name]) for name in found])
    prefixes = {joint[:-len(name)] for joint, name in zip(found, names) if joint.endswith(name)}
    model = robot.get("name", "")
    prefix = prefixes.pop() if len(prefixes) == 1 else ""
    return ArmLimits(model[len(prefix):] if model.startswith(prefix) else model, rows[:, 0], rows[:, 1],
                     np.minimum(rows[:, 2], JOINT_SPEED_CEILING), np.full(len(rows), JOINT_ACCELERATION_CEILING))


def _joint_of(name: str, known: List[str]) -> str:
    if name in known:
        return name
    fitting = [joint for joint in known if joint.endswith(name)]
    if len(fitting) != 1:
        raise UnknownLimits("the robot description has %s joint %s of the log; its joints: %s" % (
            "several that could be" if fitting else "no", name, ", ".join(known) or "none"))
    return fitting[0]


def _numbers(name: str, limit: Optional[ElementTree.Element]) -> List[float]:
    try:
        values = [float(limit.get(key, "")) for key in ("lower", "upper", "velocity")] if limit is not None else []
    except ValueError:
        values = []
    if not values or not all(map(math.isfinite, values)) or values[0] >= values[1] or values[2] <= 0.0:
        raise UnknownLimits("the robot description has no limits (lower, upper, velocity) for joint %s" % name)
    return values


def same_model(one: str, other: str) -> bool:
    """Return whether two names mean the same arm; case, blanks, ``-``, ``_`` and the maker's name do not count."""
    def plain(name: str) -> str:
        word = "".join(letter for letter in name.lower() if letter.isalnum())
        return word[len(_MAKER):] if word.startswith(_MAKER) else word
    return plain(one) == plain(other)


class LogParameters:
    """The ROS parameters that the recorder of a log found; a log without them has none (a ``.bag`` never has)."""

    def __init__(self, path: PathLike, node: str) -> None:
        """Read them; ``node`` is the driver's, as ``/left/jaka_driver``.

        Raises:
            BagError: The log cannot be read.
        """
        with open_log(path) as reader:
            found = [reader.read_attachment(entry) for entry in reader.index.attachments
                     if entry.name == PARAMETERS_NAME]
        self._tree = _parsed(found[-1]) if found else {}
        self._node = node

    def _at(self, *words: str) -> Any:
        inner: Any = self._tree
        for word in words:
            inner = inner.get(word) if isinstance(inner, dict) else None
        return inner

    @property
    def description(self) -> Optional[str]:
        """The URDF in the driver's namespace, or in one above it."""
        words = self._node.strip("/").split("/")[:-1]
        for count in range(len(words), -1, -1):
            text = self._at(*words[:count], DESCRIPTION)
            if isinstance(text, str) and text.strip():
                return text
        return None

    @property
    def model(self) -> Optional[str]:
        """The driver's parameter ``model``, where it was set."""
        model = self._at(*self._node.strip("/").split("/"), "model")
        return model if isinstance(model, str) and model else None


def _parsed(raw: bytes) -> Any:
    text = raw.decode("utf-8", "replace")
    try:
        return load_json(text)  # what the recorder writes; many times as fast as YAML
    except ValueError:
        pass
    try:
        return load_yaml(text)
    except (yaml.YAMLError, ValueError):
        return {}
