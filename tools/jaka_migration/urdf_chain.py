"""The chain of an arm in a URDF: its links, its joints, and how far it differs from a model of the driver."""
import math
from typing import Dict, List, NamedTuple, Optional, Sequence, Tuple

from jaka_migration.bounded_files import Element, number_of
from jaka_ros_driver.kinematics.arm_models import JOINT_COUNT, ArmModel
from jaka_ros_driver.kinematics.forward import forward
from jaka_ros_driver.kinematics.rotations import (
    IDENTITY,
    Transform,
    compose,
    distance_between,
    invert,
    matrix_from_rotation_vector,
    matrix_from_rpy,
    rotation_angle_between,
    transform,
)

POSITIONS: Tuple[Tuple[float, ...], ...] = (
    (0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
    (0.0, 1.57, -1.57, 1.57, 1.57, 0.0),
    (0.5, 0.3, -0.7, 0.9, -1.1, 1.3),
    (-1.2, 1.1, 0.8, -0.6, 0.4, -2.0),
    (2.5, -0.4, 1.6, 2.1, 1.9, 0.7),
    (-2.9, 1.9, -1.9, 0.2, -0.3, 3.0),
    (1.0, -1.0, 0.5, -0.5, 2.4, -1.5),
    (-0.3, 0.8, 2.0, 1.2, -2.0, 0.1),
)
"""The joint positions, rad, at which the chains are compared: fixed, so that two runs give the same numbers."""
_SAME_M, _SAME_RAD = 1e-9, 1e-7
"""The distance and angle below which two pairs of links are the same frames; the pair next to the arm counts then."""
_LONGEST_PATH = 300
"""Most links from the root to another."""
_MOST_LINKS = 30
"""Most links before the arm, or behind it, that are tried as its base or flange."""
_LARGEST_LENGTH_M = 1e3
"""Largest length, m, that is taken: beyond it the file is in other units, or damaged."""
_LARGEST_ANGLE_RAD = 1e3
"""Largest angle, rad, that is taken: beyond it the file is damaged."""


class WrongUrdf(Exception):
    """A URDF whose chain cannot be followed; the reason.

    Attributes:
        line: The line of the fault, from 1.
    """

    def __init__(self, reason: str, line: int) -> None:
        super().__init__(reason)
        self.line = line


class UrdfJoint(NamedTuple):
    """A joint of a URDF.

    Attributes:
        name: Its name.
        type: Its type, as ``revolute``.
        parent: The link before it.
        child: The link behind it.
        origin: The joint's frame in the parent link's, at position 0.
        axis: Unit vector of a joint that turns.
        limits: (lower, upper) rad; None where it has none.
        velocity: Largest speed, rad/s; None where it has none.
        line: Where it begins in the file, from 1.
    """

    name: str
    type: str
    parent: str
    child: str
    origin: Transform
    axis: Tuple[float, float, float]
    limits: Optional[Tuple[float, float]]
    velocity: Optional[float]
    line: int

    def at(self, position: float) -> Transform:
        """Return the child link's frame in the parent's, at this position, rad."""
        if self.type == "fixed":
            return self.origin
        turn = matrix_from_rotation_vector([position * part for part in self.axis])
        return compose(self.origin, transform(turn, (0.0, 0.0, 0.0)))


class Urdf(NamedTuple):
    """A robot's description.

    Attributes:
        name: The robot's name.
        links: The line of each link, by its name.
        joints: The joints by name.
        parents: The joint before each link that has one, by the link's name.
    """

    name: str
    links: Dict[str, int]
    joints: Dict[str, UrdfJoint]
    parents: Dict[str, UrdfJoint]

    def joints_before(self, link: str) -> List[UrdfJoint]:
        """Return the joints from the root to a link."""
        found: List[UrdfJoint] = []
        while link in self.parents:
            found.append(self.parents[link])
            link = found[-1].parent
        return found[::-1]


def urdf_from_xml(root: Element) -> Urdf:
    """Return the description in a URDF file.

    Raises:
        WrongUrdf: It is no URDF, or a joint lacks what the chain needs, or the links are no tree.
    """
    if root.tag != "robot":
        raise WrongUrdf("is no URDF: its root element is %s, not robot" % root.tag, root.line)
    links = {link.get("name"): link.line for link in root.all("link")}
    joints: Dict[str, UrdfJoint] = {}
    for element in root.all("joint"):
        joint = _joint(element)
        if joint.name in joints:
            raise WrongUrdf("has joint %s twice" % joint.name, joint.line)
        for link in (joint.parent, joint.child):
            if link not in links:
                raise WrongUrdf("joint %s names link %s, which is not there" % (joint.name, link or "''"), joint.line)
        joints[joint.name] = joint
    parents: Dict[str, UrdfJoint] = {}
    for joint in joints.values():
        if joint.child in parents:
            raise WrongUrdf("link %s is behind two joints, %s and %s" % (
                joint.child, parents[joint.child].name, joint.name), joint.line)
        parents[joint.child] = joint
    urdf = Urdf(root.get("name"), links, joints, parents)
    _refuse_loops(urdf)
    return urdf


def _refuse_loops(urdf: Urdf) -> None:
    """Raise WrongUrdf where a link is behind itself, or too far from the root to be followed again and again."""
    depths = {link: 0 for link in urdf.links if link not in urdf.parents}
    for link in urdf.links:
        path: List[UrdfJoint] = []
        while link not in depths:
            path.append(urdf.parents[link])
            link = path[-1].parent
            if len(path) > len(urdf.joints):
                raise WrongUrdf("link %s is behind itself" % link, path[-1].line)
        for joint in reversed(path):
            depths[joint.child] = depths[joint.parent] + 1
            if depths[joint.child] > _LONGEST_PATH:
                raise WrongUrdf("has more than %d links in a row" % _LONGEST_PATH, joint.line)


def _joint(element: Element) -> UrdfJoint:
    name = element.get("name")
    parent, child = (end.get("link") if end is not None else "" for end in map(element.first, ("parent", "child")))
    origin, limit, axis = element.first("origin"), element.first("limit"), element.first("axis")
    what = "joint %s" % name
    shift = _three(what + ": origin xyz", origin and origin.get("xyz"), (0.0, 0.0, 0.0), _LARGEST_LENGTH_M, element)
    turn = _three(what + ": origin rpy", origin and origin.get("rpy"), (0.0, 0.0, 0.0), _LARGEST_ANGLE_RAD, element)
    along = _three(what + ": axis xyz", axis and axis.get("xyz"), (1.0, 0.0, 0.0), _LARGEST_LENGTH_M, element)
    length = math.sqrt(sum(part * part for part in along))
    is_turning = element.get("type") in ("revolute", "continuous")
    if is_turning and length < 1e-6:
        raise WrongUrdf("%s has an axis without direction" % what, element.line)
    limits = None
    if limit is not None:
        low, high = number_of(limit.get("lower") or "0"), number_of(limit.get("upper") or "0")
        if low is None or high is None:
            raise WrongUrdf("%s: limit is %.40r to %.40r, no numbers" % (
                what, limit.get("lower"), limit.get("upper")), limit.line)
        limits = (low, high)
    x, y, z = (part / length if length >= 1e-6 else 0.0 for part in along)
    return UrdfJoint(
        name, element.get("type"), parent, child, origin=transform(matrix_from_rpy(turn), shift), axis=(x, y, z),
        limits=limits, velocity=number_of(limit.get("velocity")) if limit else None, line=element.line)


def _three(what: str, text: Optional[str], default: Tuple[float, ...], largest: float, element: Element
           ) -> Tuple[float, ...]:
    if not text:
        return default
    numbers = [number_of(word) for word in text.split()[:4]]
    values = tuple(number for number in numbers if number is not None)
    if len(numbers) != 3 or len(values) != 3 or max(map(abs, values)) > largest:
        raise WrongUrdf("%s is %.60r; it must be three numbers of at most %g" % (what, text, largest), element.line)
    return values


# ---- the arm in it ----

class ChainDifference(NamedTuple):
    """The distances of a chain from a model at ``POSITIONS``.

    Attributes:
        distance: Largest distance of the flanges, m.
        angle: Largest angle between them, rad.
        base: The link that is the driver's base frame.
        flange: The link that is its flange frame.
        worst: The joint position, rad, of the largest distance.
    """

    distance: float
    angle: float
    base: str
    flange: str
    worst: Tuple[float, ...]

    @property
    def size(self) -> float:
        """The difference as one number, to order by: m, with one radian as one metre."""
        return self.distance + self.angle


class ArmChain:
    """The six joints of an arm in a URDF, with the links before and behind them that are fixed to them.

    Args:
        urdf: The description.
        names: The joints' names, joint 1 first.

    Raises:
        WrongUrdf: A joint is missing, is no turning joint, or does not follow the one before.
    """

    def __init__(self, urdf: Urdf, names: Sequence[str]) -> None:
        self.joints = [urdf.joints[name] for name in names if name in urdf.joints]
        if len(self.joints) != JOINT_COUNT:
            raise WrongUrdf("has no joint %s" % ", ".join(name for name in names if name not in urdf.joints), 1)
        for joint in self.joints:
            if joint.type not in ("revolute", "continuous"):
                raise WrongUrdf("joint %s is of type %.40r; it must turn" % (joint.name, joint.type), joint.line)
        path = [joint.name for joint in urdf.joints_before(self.joints[-1].child) if joint.type != "fixed"]
        if [name for name in path if name in names] != list(names):
            raise WrongUrdf("its joints follow each other as %s; the driver's order is %s" % (
                ", ".join(path), ", ".join(names)), self.joints[0].line)
        between = urdf.joints_before(self.joints[-1].child)
        between = between[[joint.name for joint in between].index(names[0]):]
        strange = [joint.name for joint in between if joint.type != "fixed" and joint.name not in names]
        if strange:
            raise WrongUrdf("has joint %s within the arm" % ", ".join(strange), self.joints[0].line)
        self._moves = [(joint, list(names).index(joint.name) if joint.name in names else -1) for joint in between]
        self._bases = _fixed_before(urdf, self.joints[0].parent)
        self._flanges = _fixed_behind(urdf, self.joints[-1].child)

    def _arm(self, position: Sequence[float]) -> Transform:
        frame = IDENTITY
        for joint, index in self._moves:
            frame = compose(frame, joint.at(position[index] if index >= 0 else 0.0))
        return frame

    def difference(self, model: ArmModel) -> ChainDifference:
        """Return the smallest difference from a model over all pairs of links that can be base and flange."""
        arms = [self._arm(position) for position in POSITIONS]
        wanted = [forward(model, position) for position in POSITIONS]
        best = None
        for base, to_arm in self._bases:
            for flange, from_arm in self._flanges:
                frames = [compose(compose(to_arm, arm), from_arm) for arm in arms]
                found = _difference(frames, wanted, base, flange)
                if best is None or found.distance < best.distance - _SAME_M or (
                        found.distance < best.distance + _SAME_M and found.angle < best.angle - _SAME_RAD):
                    best = found
        assert best is not None  # there is always the link before joint 1, and the one behind joint 6
        return best

    def fixed_offset(self, model: ArmModel, base: str, flange: str
                     ) -> Tuple[Optional[Transform], Optional[Transform]]:
        """Return the fixed offsets that would explain a difference: of the base frame, and of the flange frame.

        An offset is None where the chain differs otherwise.

        Args:
            model: The model from which the chain differs.
            base: A link before the arm that is fixed to it.
            flange: A link behind the arm that is fixed to it.
        """
        to_arm, from_arm = dict(self._bases)[base], dict(self._flanges)[flange]
        frames = [compose(compose(to_arm, self._arm(position)), from_arm) for position in POSITIONS]
        wanted = [forward(model, position) for position in POSITIONS]
        bases = [compose(frame, invert(other)) for frame, other in zip(frames, wanted)]
        flanges = [compose(invert(other), frame) for frame, other in zip(frames, wanted)]
        return _constant(bases), _constant(flanges)


def _constant(frames: List[Transform], distance: float = 1e-3, angle: float = 2e-3) -> Optional[Transform]:
    is_same = all(distance_between(frame, frames[0]) <= distance and rotation_angle_between(frame, frames[0]) <= angle
                  for frame in frames)
    return frames[0] if is_same else None


def _difference(frames: List[Transform], wanted: List[Transform], base: str, flange: str) -> ChainDifference:
    distances = [distance_between(frame, other) for frame, other in zip(frames, wanted)]
    angle = max(rotation_angle_between(frame, other) for frame, other in zip(frames, wanted))
    return ChainDifference(max(distances), angle, base, flange, POSITIONS[distances.index(max(distances))])


def _fixed_before(urdf: Urdf, link: str) -> List[Tuple[str, Transform]]:
    """Return a link and those before it to which it is fixed, each with the frame of ``link`` in it."""
    found = [(link, IDENTITY)]
    while link in urdf.parents and urdf.parents[link].type == "fixed":
        joint = urdf.parents[link]
        found.append((joint.parent, compose(joint.origin, found[-1][1])))
        link = joint.parent
    return found[:_MOST_LINKS]


def _fixed_behind(urdf: Urdf, link: str) -> List[Tuple[str, Transform]]:
    """Return a link and those behind it that are fixed to it, each with its frame in that of ``link``."""
    found = [(link, IDENTITY)]
    for name, frame in found:  # it grows while it is read
        found += [(joint.child, compose(frame, joint.origin)) for joint in urdf.joints.values()
                  if joint.parent == name and joint.type == "fixed"]
        if len(found) > _MOST_LINKS:
            break
    return found[:_MOST_LINKS]
