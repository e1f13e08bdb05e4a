"""The arm models: DH parameters, limits and speeds, from ``data/models.yaml`` or from a user's file.

A model file holds one model, with the keys of one entry of ``data/models.yaml``::

    name: my_zu5                      # optional; the file's name without its ending otherwise
    family: three_parallel_offset_wrist
    dh_standard:                      # six rows, joint 1 first: mm and rad
    - {a: 0.0, d: 121.1, alpha: 1.5707963267948966, theta_offset: 0.0}
    ...
    joint_limits_deg: [[-360, 360], [-85, 265], [-175, 175], [-85, 265], [-360, 360], [-360, 360]]
    joint_max_speed_deg_s: [180, 180, 180, 180, 180, 180]
    tcp_max_speed_m_s: 3.0            # optional, null where unknown
    joint_max_acceleration_deg_s2: [720, 720, 720, 720, 720, 720]    # optional
    tcp_max_acceleration_m_s2: 8.0    # optional
    dh_confidence: calibrated         # optional, free text; so are note and sources (a list)

DH is standard: T_i = Rz(theta_i + theta_offset) Tz(d) Tx(a) Rx(alpha). A calibrated arm may differ from its family's
structure by ``STRUCTURE_TOLERANCE_M`` and ``STRUCTURE_TOLERANCE_RAD``; inverse kinematics then refines the closed form.
"""
import difflib
import math
import os
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any, Dict, List, Mapping, Optional, Tuple

from jaka_ros_driver import units
from jaka_ros_driver.errors import InvalidCommand
from jaka_ros_driver.state import Vector
from jaka_ros_driver.yaml_text import load_yaml, short

MODELS_FILE = os.path.join(os.path.dirname(os.path.abspath(__file__)), "data", "models.yaml")

JOINT_COUNT = 6
THREE_PARALLEL = "three_parallel_offset_wrist"
SPHERICAL_WRIST = "spherical_wrist_shoulder_offset"
TWO_PARALLEL = "two_parallel_three_intersecting_pairs"

DEFAULT_JOINT_ACCELERATION = 4.0 * math.pi
"""Default joint acceleration, 720 deg/s2: libjaka's bound and the ceiling of docs/controller-protocol.md section 5.2.
"""
DEFAULT_TCP_ACCELERATION = 8.0
"""Default tool acceleration, m/s2: libjaka's bound and the ceiling of docs/controller-protocol.md section 5.4.1."""

STRUCTURE_TOLERANCE_M = 0.01
"""Largest difference, m, of a calibrated row from its structure; with more the refinement of the closed form begins too
far off."""
STRUCTURE_TOLERANCE_RAD = units.deg_to_rad(2.0)
"""The same for its angle, rad."""

_TOTAL_LENGTH = (0.1, 20.0)
"""Smallest and largest sum, m, of all |a| and |d| of a real arm; it detects a file in metres."""
_HALF_PI = math.pi / 2.0
_STRUCTURES: Mapping[str, Tuple[Tuple[float, ...], Tuple[bool, ...], Tuple[bool, ...]]] = {
    THREE_PARALLEL: ((_HALF_PI, 0.0, 0.0, _HALF_PI, -_HALF_PI, 0.0),
                     (False, True, True, False, False, False), (True, True, True, True, True, True)),
    SPHERICAL_WRIST: ((_HALF_PI, 0.0, -_HALF_PI, _HALF_PI, -_HALF_PI, 0.0),
                      (False, True, False, False, False, False), (True, True, True, True, False, True)),
    TWO_PARALLEL: ((_HALF_PI, 0.0, _HALF_PI, -_HALF_PI, _HALF_PI, 0.0),
                   (False, True, False, False, False, False), (True, True, True, True, True, True)),
}
"""The structure of each family: alpha, rad; which a and which d may differ from 0. Source: meta.families of the data
file.
"""

_REQUIRED_KEYS = ("family", "dh_standard", "joint_limits_deg", "joint_max_speed_deg_s")
_OPTIONAL_KEYS = ("name", "tcp_max_speed_m_s", "joint_max_acceleration_deg_s2", "tcp_max_acceleration_m_s2",
                  "dh_confidence", "note", "sources")
_NOTED_KEYS = ("payload_kg_by_name", "joint_max_speed_urdf_rad_s", "dh_alternatives", "joint_limits_alternatives_deg",
               "joint_max_speed_alternatives_deg_s")
"""Keys for readers of the data file, which the code does not use."""


@dataclass(frozen=True)
class DhRow:
    """One row of the standard DH table: a, d in m; alpha, theta_offset in rad."""

    a: float
    d: float
    alpha: float
    theta_offset: float = 0.0


@dataclass(frozen=True)
class ArmModel:
    """One arm: geometry and limits.

    Attributes:
        name: As ``load_model`` takes it.
        family: THREE_PARALLEL, SPHERICAL_WRIST or TWO_PARALLEL; chooses the inverse kinematics.
        dh: Six rows, joint 1 (base) first.
        joint_limits: (low, high) a joint, rad.
        joint_max_speed: rad/s, shape (6,).
        tcp_max_speed: m/s; None where no source gives one.
        joint_max_acceleration: rad/s2, shape (6,); a default for simulation, no vendor value exists.
        tcp_max_acceleration: m/s2; a default for simulation, no vendor value exists.
        dh_confidence: How well the DH values are evidenced; the words are explained in the data file.
        note: What is peculiar about the values.
        sources: Where the values come from.
        is_exact: True where the DH table has exactly its family's structure.
        has_closed_form: True where inverse kinematics is closed form alone: is_exact, and not the A12's family.
        structural_dh: The table with everything set to the family's structure; equals ``dh`` where is_exact.
        link_terms: Per joint (a, d, cos alpha, sin alpha, theta_offset), for the hot path.
    """

    name: str
    family: str
    dh: Tuple[DhRow, ...]
    joint_limits: Tuple[Tuple[float, float], ...]
    joint_max_speed: Vector
    tcp_max_speed: Optional[float] = None
    joint_max_acceleration: Vector = (DEFAULT_JOINT_ACCELERATION,) * JOINT_COUNT
    tcp_max_acceleration: float = DEFAULT_TCP_ACCELERATION
    dh_confidence: str = ""
    note: str = ""
    sources: Tuple[str, ...] = ()
    is_exact: bool = field(init=False, repr=False, compare=False)
    has_closed_form: bool = field(init=False, repr=False, compare=False)
    structural_dh: Tuple[DhRow, ...] = field(init=False, repr=False, compare=False)
    link_terms: Tuple[Tuple[float, float, float, float, float], ...] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        """Check the table; raise InvalidCommand for an unknown family, another structure or a link without length."""
        if self.family not in _STRUCTURES:
            raise InvalidCommand("model %s: family %r is unknown; known: %s"
                                 % (self.name, self.family, ", ".join(sorted(_STRUCTURES))))
        structural = tuple(_to_structure(self.name, self.family, n, row) for n, row in enumerate(self.dh))
        fore = structural[2].a if self.family == THREE_PARALLEL else structural[3].d
        if structural[1].a <= 0.0 or fore <= 0.0:
            raise InvalidCommand("model %s: upper arm %.6g m (row 2: a) and forearm %.6g m (row %s) must be above 0"
                                 % (self.name, structural[1].a, fore,
                                    "3: a" if self.family == THREE_PARALLEL else "4: d"))
        object.__setattr__(self, "structural_dh", structural)
        object.__setattr__(self, "is_exact", structural == self.dh)
        object.__setattr__(self, "has_closed_form", structural == self.dh and self.family != TWO_PARALLEL)
        object.__setattr__(self, "link_terms", tuple(
            (row.a, row.d, _snap(math.cos(row.alpha)), _snap(math.sin(row.alpha)), row.theta_offset)
            for row in self.dh))


def _snap(value: float) -> float:
    """Round a sine or cosine that differs from a whole number by rounding only, as cos(pi/2) does."""
    nearest = float(round(value))
    return nearest if abs(value - nearest) < 1e-15 else value


def _to_structure(name: str, family: str, index: int, row: DhRow) -> DhRow:
    alphas, free_a, free_d = _STRUCTURES[family]
    alpha = alphas[index]
    a = row.a if free_a[index] else 0.0
    d = row.d if free_d[index] else 0.0
    if (abs(row.alpha - alpha) > STRUCTURE_TOLERANCE_RAD or abs(row.a - a) > STRUCTURE_TOLERANCE_M
            or abs(row.d - d) > STRUCTURE_TOLERANCE_M):
        raise InvalidCommand(
            "model %s: DH row %d (a %.6g m, d %.6g m, alpha %.6g rad) does not fit family %s,"
            " which has%s%s alpha %.6g rad"
            % (name, index + 1, row.a, row.d, row.alpha, family, "" if free_a[index] else " a 0,",
               "" if free_d[index] else " d 0,", alpha))
    return DhRow(a, d, alpha, row.theta_offset)


def model_names() -> Tuple[str, ...]:
    """Return the names of the models of the data file, as ``load_model`` takes them."""
    return tuple(_data()["models"])


@lru_cache(maxsize=None)
def load_model(name: str) -> ArmModel:
    """Return the model of this name; case, spaces, ``-`` and ``_`` are ignored (``Zu 7`` is ``zu7``).

    Raises:
        InvalidCommand: No model has this name; the message has the nearest name and all names.
    """
    key = str(name).lower().replace(" ", "").replace("-", "").replace("_", "")
    if key.startswith("jaka"):
        key = key[4:]
    models = _data()["models"]
    if key not in models:
        near = difflib.get_close_matches(key, models, cutoff=0.0)
        raise InvalidCommand("unknown arm model %r; nearest is %r; known: %s" % (name, near[0], ", ".join(models)))
    return _model_from_entry(key, models[key], _data()["meta"]["dh_confidence"])


def file_or_none(text: str) -> str:
    """Return the path of a model file, "" for ``none``: an empty default of an argument looks required to roslaunch."""
    return "" if text == "none" else text


def load_model_file(path: str) -> ArmModel:
    """Return the model in a user's file; the format stands at the top of this module.

    Raises:
        InvalidCommand: The file cannot be read or a value is wrong; the message names file, key and value.
    """
    name = os.path.splitext(os.path.basename(path))[0]
    try:
        with open(path, encoding="utf-8") as file:
            entry = load_yaml(file.read())
        if not isinstance(entry, dict):
            raise InvalidCommand("holds no mapping of keys to values")
        return _model_from_entry(_text(entry, "name", name), entry, {})
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else _one_line(error)
        raise InvalidCommand("model file %s: cannot be read: %s" % (path, reason)) from error
    except InvalidCommand as error:
        raise InvalidCommand("model file %s: %s" % (path, error)) from error


@lru_cache(maxsize=None)
def _data() -> Dict[str, Any]:
    import yaml  # imported here, because most users of this module's classes never read a file
    with open(MODELS_FILE, encoding="utf-8") as file:  # a file of this project, which the loader in C reads faster
        data: Dict[str, Any] = yaml.load(file, Loader=getattr(yaml, "CSafeLoader", yaml.SafeLoader))
    return data


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split())


def _model_from_entry(name: str, entry: Mapping[str, object], confidence_words: Mapping[str, str]) -> ArmModel:
    known = _REQUIRED_KEYS + _OPTIONAL_KEYS + _NOTED_KEYS
    for key in _REQUIRED_KEYS:
        if key not in entry:
            raise InvalidCommand("key %s is missing" % key)
    for key in entry:
        if not isinstance(key, str):
            raise InvalidCommand("has the key %s; a key must be a text" % short(key))
        if key not in known:
            raise InvalidCommand("unknown key %s; nearest known is %s"
                                 % (key, difflib.get_close_matches(key, known, cutoff=0.0)[0]))
    rows = _list(entry, "dh_standard", JOINT_COUNT)
    dh = tuple(_dh_row("dh_standard row %d" % (n + 1), row) for n, row in enumerate(rows))
    limits = tuple(_limit_pair("joint_limits_deg of joint %d" % (n + 1), pair)
                   for n, pair in enumerate(_list(entry, "joint_limits_deg", JOINT_COUNT)))
    total = sum(abs(row.a) + abs(row.d) for row in dh)
    if not _TOTAL_LENGTH[0] <= total <= _TOTAL_LENGTH[1]:
        raise InvalidCommand("dh_standard: all a and d together are %.4g mm; lengths must be in mm"
                             % units.m_to_mm(total))
    confidence = _text(entry, "dh_confidence", "")
    sources = entry.get("sources", [confidence_words[confidence]] if confidence in confidence_words else [])
    if not isinstance(sources, list) or not all(isinstance(source, str) for source in sources):
        raise InvalidCommand("sources is %s; it must be a list of texts" % short(sources))
    optional: Dict[str, Any] = {}
    if "joint_max_acceleration_deg_s2" in entry:
        optional["joint_max_acceleration"] = _rates(entry, "joint_max_acceleration_deg_s2")
    if entry.get("tcp_max_acceleration_m_s2") is not None:
        optional["tcp_max_acceleration"] = _positive("tcp_max_acceleration_m_s2", entry["tcp_max_acceleration_m_s2"])
    if entry.get("tcp_max_speed_m_s") is not None:
        optional["tcp_max_speed"] = _positive("tcp_max_speed_m_s", entry["tcp_max_speed_m_s"])
    return ArmModel(
        name=name, family=_text(entry, "family", ""), dh=dh, joint_limits=limits,
        joint_max_speed=_rates(entry, "joint_max_speed_deg_s"), dh_confidence=confidence,
        note=_text(entry, "note", "") if entry.get("note") else "", sources=tuple(sources), **optional)


def _text(entry: Mapping[str, object], key: str, default: str) -> str:
    value = entry.get(key, default)
    if not isinstance(value, str):
        raise InvalidCommand("%s is %s; it must be a text" % (key, short(value)))
    return value


def _number(what: str, value: object) -> float:
    number = float(value) if isinstance(value, float) or type(value) is int and abs(value) < 1e300 else math.nan
    if not math.isfinite(number):
        raise InvalidCommand("%s is %s; it must be a finite number" % (what, short(value)))
    return number


def _positive(what: str, value: object) -> float:
    number = _number(what, value)
    if number <= 0.0:
        raise InvalidCommand("%s is %r; it must be above 0" % (what, value))
    return number


def _list(entry: Mapping[str, object], key: str, length: int) -> List[object]:
    value = entry[key]
    if not isinstance(value, list) or len(value) != length:
        raise InvalidCommand("%s must be a list of %d, not %s" % (
            key, length, "%d" % len(value) if isinstance(value, list) else short(value)))
    return value


def _rates(entry: Mapping[str, object], key: str) -> Vector:
    return tuple(units.deg_to_rad(_positive("%s of joint %d" % (key, n + 1), value))
                 for n, value in enumerate(_list(entry, key, JOINT_COUNT)))


def _dh_row(what: str, row: object) -> DhRow:
    if not isinstance(row, dict):
        raise InvalidCommand("%s is %s; it must be a mapping with a, d, alpha, theta_offset" % (what, short(row)))
    for key in ("a", "d", "alpha"):
        if key not in row:
            raise InvalidCommand("%s lacks %s" % (what, key))
    for key in row:
        if key not in ("a", "d", "alpha", "theta_offset"):
            raise InvalidCommand("%s has the unknown key %s" % (what, key if isinstance(key, str) else short(key)))
    return DhRow(
        a=units.mm_to_m(_number(what + ": a", row["a"])), d=units.mm_to_m(_number(what + ": d", row["d"])),
        alpha=_number(what + ": alpha", row["alpha"]),
        theta_offset=_number(what + ": theta_offset", row.get("theta_offset", 0.0)))


def _limit_pair(what: str, pair: object) -> Tuple[float, float]:
    if not isinstance(pair, list) or len(pair) != 2:
        raise InvalidCommand("%s is %s; it must be [low, high]" % (what, short(pair)))
    low, high = _number(what, pair[0]), _number(what, pair[1])
    if low >= high:
        raise InvalidCommand("%s is %r; low must be below high" % (what, pair))
    return units.deg_to_rad(low), units.deg_to_rad(high)
