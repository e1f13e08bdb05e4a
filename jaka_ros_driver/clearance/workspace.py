"""Zones around the arm and the tool that it carries, from a mapping or a YAML file.

All lengths are in m and all angles in rad, in the base frame of the arm; the tool's in the frame of the flange::

    keep_out:                        # boxes that no part of the arm enters, from the upper arm on
      - {name: press, centre: [0.6, 0.0, 0.2], size: [0.3, 0.4, 0.4], rpy: [0.0, 0.0, 0.5]}
    keep_in:                         # boxes that no part of the arm leaves
      - {name: cell, centre: [0.0, 0.0, 0.5], size: [2.0, 2.0, 2.0]}
    cylinders:                       # upright ones that no part of the arm enters
      - {name: post, foot: [0.0, -0.7, 0.0], height: 1.0, radius: 0.05}
    floor: -0.01                     # height above which all parts stay
    tool:                            # capsules of the tool and of what it holds
      - {name: gripper, start: [0.0, 0.0, 0.0], end: [0.0, 0.0, 0.15], radius: 0.04}

Every key may be missing; ``rpy`` (rotations about the fixed axes x, y, z) too, which is [0, 0, 0] then.
"""
import difflib
import math
import os
from typing import Any, Dict, List, Mapping, NamedTuple, Optional, Sequence, Tuple

from jaka_ros_driver.clearance.distances import SignedDistance
from jaka_ros_driver.clearance.shape import FLANGE_FRAME, Capsule
from jaka_ros_driver.errors import InvalidCommand
from jaka_ros_driver.kinematics.rotations import Vector3, matrix_from_rpy
from jaka_ros_driver.yaml_text import load_yaml, short

MOST_BYTES = 100000
"""Largest size of a workspace file."""
MOST_ITEMS = 50
"""Most zones of a kind, and capsules of a tool."""
ARM_PARTS = 6
"""Most parts of an arm that zones concern."""
MOST_PAIRS = 500
"""Most pairs of a zone with a part of the arm or the tool: each costs time in every look at the arm."""
COORDINATE_LIMIT = 10.0
"""Largest coordinate, m, as of a target: a file in mm is noticed."""
SIZES = (0.001, 20.0)
"""Smallest and largest edge, height, and radius of a cylinder, m."""
TOOL_COORDINATE_LIMIT = 2.0
"""Largest coordinate, m, of a tool's capsule in the flange: no arm carries one so long, a file in mm is noticed."""
TOOL_RADII = (0.001, 0.5)
"""Smallest and largest radius, m, of a tool's capsule: a file in mm is noticed."""
ANGLE_LIMIT = 2.0 * math.pi
"""Largest angle of an rpy, rad: a whole turn; a file in degrees is noticed."""
LONGEST_NAME = 100
"""Most characters of a zone's name, which stands in every message about the zone."""


class Box(NamedTuple):
    """A box in the base frame: its name, centre and edges, m, and its orientation, rpy, rad."""

    name: str
    centre: Vector3
    size: Vector3
    rpy: Vector3 = (0.0, 0.0, 0.0)

    def signed_distance(self) -> SignedDistance:
        """Return the function that gives a point's signed distance, m, from the box."""
        cx, cy, cz = self.centre
        hx, hy, hz = (0.5 * edge for edge in self.size)
        xx, yx, zx, xy, yy, zy, xz, yz, zz = matrix_from_rpy(self.rpy)

        def signed(x: float, y: float, z: float) -> float:
            x, y, z = x - cx, y - cy, z - cz
            dx = abs(xx * x + xy * y + xz * z) - hx
            dy = abs(yx * x + yy * y + yz * z) - hy
            dz = abs(zx * x + zy * y + zz * z) - hz
            largest = max(dx, dy, dz)
            if largest <= 0.0:
                return largest
            dx, dy, dz = max(dx, 0.0), max(dy, 0.0), max(dz, 0.0)
            return math.sqrt(dx * dx + dy * dy + dz * dz)
        return signed


class Cylinder(NamedTuple):
    """An upright cylinder in the base frame: its name, the centre of its foot, height and radius, m."""

    name: str
    foot: Vector3
    height: float
    radius: float

    def signed_distance(self) -> SignedDistance:
        """Return the function that gives a point's signed distance, m, from the cylinder."""
        cx, cy, half, radius = self.foot[0], self.foot[1], 0.5 * self.height, self.radius
        cz = self.foot[2] + half

        def signed(x: float, y: float, z: float) -> float:
            side, end = math.hypot(x - cx, y - cy) - radius, abs(z - cz) - half
            if side <= 0.0 or end <= 0.0:
                return max(side, end)
            return math.hypot(side, end)
        return signed


class Workspace(NamedTuple):
    """Zones around the arm, and the capsules of its tool.

    Attributes:
        keep_out: Boxes that no part of the arm enters.
        keep_in: Boxes that no part of the arm leaves.
        cylinders: Cylinders that no part of the arm enters.
        floor: Height in the base frame, m, above which all parts stay; None for no floor.
        tool: Capsules in the flange's frame.
    """

    keep_out: Tuple[Box, ...] = ()
    keep_in: Tuple[Box, ...] = ()
    cylinders: Tuple[Cylinder, ...] = ()
    floor: Optional[float] = None
    tool: Tuple[Capsule, ...] = ()

    @property
    def zones(self) -> int:
        """The number of zones."""
        return len(self.keep_out) + len(self.keep_in) + len(self.cylinders) + (self.floor is not None)

    def as_mapping(self) -> Dict[str, Any]:
        """Return the mapping of lists, texts and numbers of which ``workspace_of`` makes this workspace."""
        def items(zones: Sequence[Any], keys: Sequence[str]) -> List[Dict[str, Any]]:
            return [{key: list(value) if isinstance(value, tuple) else value
                     for key, value in ((key, getattr(zone, key)) for key in keys)} for zone in zones]
        mapping: Dict[str, Any] = {
            "keep_out": items(self.keep_out, Box._fields), "keep_in": items(self.keep_in, Box._fields),
            "cylinders": items(self.cylinders, Cylinder._fields), "tool": items(self.tool, _TOOL_KEYS)}
        if self.floor is not None:
            mapping["floor"] = self.floor
        return mapping

    def as_yaml(self) -> str:
        """Return the text of which ``workspace_of_text`` makes this workspace."""
        import yaml  # imported here, because most cells have no workspace
        return str(yaml.safe_dump(self.as_mapping(), sort_keys=False, allow_unicode=True, width=120))

    def summary(self) -> str:
        """Return in words how many zones and parts of a tool there are."""
        return "%d zone%s and %d part%s of a tool" % (
            self.zones, "" if self.zones == 1 else "s", len(self.tool), "" if len(self.tool) == 1 else "s")


_TOOL_KEYS = ("name", "start", "end", "radius")
NO_ZONES = Workspace()


def load_workspace(path: str) -> Workspace:
    """Return the workspace in a YAML file; the format stands at the top of this module.

    Raises:
        InvalidCommand: The file cannot be read, is too large or wrong; the message names file, key, value and range.
    """
    try:
        if os.path.getsize(path) > MOST_BYTES:
            raise InvalidCommand("has more than %d bytes" % MOST_BYTES)
        with open(path, encoding="utf-8") as file:
            content = load_yaml(file.read())
        return workspace_of({} if content is None else content)
    except InvalidCommand as error:
        raise InvalidCommand("workspace file %s: %s" % (path, error)) from error
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else _one_line(error)
        raise InvalidCommand("workspace file %s: cannot be read: %s" % (path, reason)) from error


def workspace_of_text(text: str) -> Workspace:
    """Return the workspace in a text of YAML.

    Raises:
        InvalidCommand: It is too long, wrong, or holds nothing; the message names key, value and range.
    """
    if len(text.encode("utf-8", "surrogatepass")) > MOST_BYTES:
        raise InvalidCommand("the yaml has more than %d bytes" % MOST_BYTES)
    try:
        content = load_yaml(text)
    except InvalidCommand as error:
        raise InvalidCommand("the yaml %s" % error) from error
    if content is None:
        raise InvalidCommand("the yaml holds nothing; {} is a workspace without zones and tool")
    return workspace_of(content)


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split())


def workspace_of(mapping: Any) -> Workspace:
    """Return the workspace of a mapping; the format stands at the top of this module.

    Raises:
        InvalidCommand: A key is unknown or missing, or a value is wrong; the message names key, value and range.
    """
    _check_keys("workspace", mapping, (), Workspace._fields)
    floor = mapping.get("floor")
    workspace = Workspace(
        keep_out=tuple(map(_box, *_items(mapping, "keep_out"))),
        keep_in=tuple(map(_box, *_items(mapping, "keep_in"))),
        cylinders=tuple(map(_cylinder, *_items(mapping, "cylinders"))),
        floor=None if floor is None else _number("floor", floor, -COORDINATE_LIMIT, COORDINATE_LIMIT),
        tool=tuple(map(_tool_capsule, *_items(mapping, "tool"))))
    parts = ARM_PARTS + len(workspace.tool)
    if workspace.zones * parts > MOST_PAIRS:
        raise InvalidCommand("%d zones and %d parts of arm and tool make %d pairs; at most %d can be looked at in time"
                             % (workspace.zones, parts, workspace.zones * parts, MOST_PAIRS))
    return workspace


def _items(mapping: Mapping[str, Any], key: str) -> Tuple[List[str], List[Any]]:
    """Return the places, as error texts name them, and the items of a list."""
    items = mapping.get(key)
    if items is None:
        items = []
    if not isinstance(items, list) or len(items) > MOST_ITEMS:
        raise InvalidCommand("%s is %s; it must be a list of at most %d" % (
            key, "a list of %d" % len(items) if isinstance(items, list) else short(items), MOST_ITEMS))
    return ["%s %d" % (key, n + 1) for n in range(len(items))], items


def _box(place: str, item: Any) -> Box:
    _check_keys(place, item, ("name", "centre", "size"), ("rpy",))
    return Box(_name(place, item), _vector(place, item, "centre", -COORDINATE_LIMIT, COORDINATE_LIMIT),
               _vector(place, item, "size", *SIZES),
               _vector(place, item, "rpy", -ANGLE_LIMIT, ANGLE_LIMIT) if "rpy" in item else (0.0, 0.0, 0.0))


def _cylinder(place: str, item: Any) -> Cylinder:
    _check_keys(place, item, Cylinder._fields, ())
    return Cylinder(_name(place, item), _vector(place, item, "foot", -COORDINATE_LIMIT, COORDINATE_LIMIT),
                    _number(place + ": height", item["height"], *SIZES),
                    _number(place + ": radius", item["radius"], *SIZES))


def _tool_capsule(place: str, item: Any) -> Capsule:
    _check_keys(place, item, _TOOL_KEYS, ())
    return Capsule(_name(place, item), FLANGE_FRAME,
                   _vector(place, item, "start", -TOOL_COORDINATE_LIMIT, TOOL_COORDINATE_LIMIT),
                   _vector(place, item, "end", -TOOL_COORDINATE_LIMIT, TOOL_COORDINATE_LIMIT),
                   _number(place + ": radius", item["radius"], *TOOL_RADII))


def _check_keys(place: str, item: Any, required: Sequence[str], optional: Sequence[str]) -> None:
    if not isinstance(item, dict):
        raise InvalidCommand("%s is %s; it must be a mapping of keys to values" % (place, short(item)))
    known = tuple(required) + tuple(optional)
    for key in item:
        if not isinstance(key, str):
            raise InvalidCommand("%s has the key %s; a key must be a text" % (place, short(key)))
        if key not in known:
            raise InvalidCommand("%s has the unknown key %s; nearest known is %s" % (
                place, short(key), difflib.get_close_matches(key[:LONGEST_NAME], known, n=1, cutoff=0.0)[0]))
    for key in required:
        if key not in item:
            raise InvalidCommand("%s lacks the key %s" % (place, key))


def _name(place: str, item: Mapping[str, Any]) -> str:
    name = item["name"]
    if not isinstance(name, str) or not name.strip() or len(name) > LONGEST_NAME or not name.isprintable():
        raise InvalidCommand("%s: name is %s; it must be a text of 1 to %d characters" % (
            place, short(name), LONGEST_NAME))
    return name


def _number(place: str, value: Any, low: float, high: float) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not low <= value <= high:
        raise InvalidCommand("%s is %s; it must be a number from %g to %g" % (place, short(value), low, high))
    return float(value)


def _vector(place: str, item: Mapping[str, Any], key: str, low: float, high: float) -> Vector3:
    value = item[key]
    if not isinstance(value, (list, tuple)) or len(value) != 3:
        raise InvalidCommand("%s: %s is %s; it must be a list of three numbers" % (place, key, short(value)))
    x, y, z = (_number("%s: %s" % (place, key), number, low, high) for number in value)
    return x, y, z
