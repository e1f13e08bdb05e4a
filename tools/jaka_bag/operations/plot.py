"""Pictures of a state log: joints, TCP position and path, states over time (SVG or PNG, by matplotlib)."""
import importlib
from pathlib import Path
from typing import Any, Container, Dict, Iterable, List, Mapping, NamedTuple, Optional, Sequence, Tuple, Union

import numpy as np

from ..driver_interface import MotionState
from ..errors import BagError, MissingDependency
from ..messages.batch import Array
from ..messages.columns import Columns, by_name
from ..messages.connection import Connection
from ..messages.encodings import described
from ..output_file import OutputFile
from ..paths import PathLike
from ..units import NS_PER_S
from .thinning import Changes, EveryNth, MinMax
from .tool_poses import POSE_FIELDS, are_numbers, tool_poses

FORMATS = (".svg", ".png")
_MAX_POINTS = 4000
"""Points of a curve: more than any screen or page has pixels across."""
_MOST_CHANGES = 100000
"""Changes of a state that are drawn; a field that changes with each message is no state."""
_LEAST_GAP_S, _USUAL_INTERVALS, _STEADY = 0.3, 8.0, 20
"""Gap, s and in usual intervals, over which no line is led; how many steps show what is usual."""
_FLAGS = ("power_state", "servo_state", "collision_state")
_STATES = ("motion_state", *_FLAGS)
JOINT_TYPE = "sensor_msgs/JointState"


class Panel(NamedTuple):
    """One diagram: its title, the label of its vertical axis, and lines (name, time in s, values)."""

    title: str
    unit: str
    lines: Tuple[Tuple[str, Array, Array], ...]
    is_steps: bool = False
    ticks: Tuple[Tuple[int, str], ...] = ()


def thin(time: Array, values: Array, limit: int = _MAX_POINTS) -> Tuple[Array, Array]:
    """Reduce a curve to about ``limit`` points that show the same: smallest and largest value of each stretch."""
    if len(time) <= limit:
        return time, values
    edges = np.linspace(0, len(time), limit // 2 + 1).astype(np.int64)
    begins = edges[:-1]
    keep = [np.zeros(1, np.int64), np.array([len(time) - 1])]
    for pick in (np.fmin, np.fmax):
        extreme = pick.reduceat(values, begins)
        matches = np.flatnonzero(values == np.repeat(extreme, np.diff(edges)))
        stretch = np.searchsorted(edges, matches, side="right") - 1
        keep.append(matches[np.unique(stretch, return_index=True)[1]])
    which = np.unique(np.concatenate(keep))
    return time[which], values[which]


class _Curves:
    """The lines of one diagram, of samples that come piece by piece."""

    def __init__(self, title: str, unit: str, names: Sequence[str], ticks: Tuple[Tuple[int, str], ...] = (),
                 is_steps: bool = False) -> None:
        self.title, self._unit, self.names = title, unit, tuple(names)
        self._ticks, self._is_steps = ticks, is_steps
        self._lines: List[Union[MinMax, Changes]] = [
            Changes(_MOST_CHANGES) if is_steps else MinMax(_MAX_POINTS) for _ in names]
        self._gaps: List[float] = []
        self._until = np.zeros(0)
        self._usual = np.inf

    def add(self, time: Array, columns: Iterable[Array]) -> None:
        """Add further samples: s, and the values of each line."""
        places, gaps = self._gaps_before(time)
        if self._is_steps:  # a value lasts to the gap
            time = np.insert(time, places, gaps)
            columns = [np.insert(values.astype(float), places, np.nan) for values in columns]
        else:  # so many samples at a time are one point that a number among them would be lost there
            self._gaps += gaps.tolist()
        for line, values in zip(self._lines, columns):
            line.add(time, values)

    def _gaps_before(self, time: Array) -> Tuple[Array, Array]:
        """Return before which samples there is a gap, and a time within each, s: (k,) each."""
        times = np.concatenate([self._until, time])
        self._until = times[-1:]
        steps = np.diff(times)
        if len(steps) >= _STEADY:
            self._usual = float(np.median(steps))
        before = np.flatnonzero(steps > max(_LEAST_GAP_S, _USUAL_INTERVALS * self._usual))
        return before + 1 - (len(times) - len(time)), times[before] + 0.5 * steps[before]

    def panel(self, earlier_s: float) -> Panel:
        """Return the diagram, its times ``earlier_s`` earlier."""
        lines = []
        for name, line in zip(self.names, self._lines):
            time, values = line.points()
            places = np.searchsorted(time, self._gaps)
            lines.append((name, np.insert(time, places, self._gaps) - earlier_s,
                          np.insert(values.astype(float), places, np.nan)))
        return Panel(self.title, self._unit, tuple(lines), self._is_steps, self._ticks)


class _TopicSketch:
    """The diagrams of one topic, and the path where it is one of tool poses."""

    def __init__(self, topic: str) -> None:
        self._topic = topic
        self.rank = 0
        self.curves: List[_Curves] = []
        self.path: Optional[EveryNth] = None
        self.note = ""
        self._is_undrawable = False
        self._joints: Optional[Array] = None

    def _same_as_before(self, curves: Sequence[_Curves]) -> List[_Curves]:
        self.curves = self.curves or list(curves)
        return self.curves

    def add(self, time: Array, columns: Columns) -> None:
        """Add the columns that the topic's type defines, at times in s, shape (n,)."""
        poses = tool_poses(columns)
        if columns.connection.datatype == JOINT_TYPE:
            self._add_joints(time, columns)
        elif poses is not None:
            placed, turned = self._same_as_before([_Curves(self._topic + "  position", "m", "xyz"),
                                                   _Curves(self._topic + "  rotation vector", "rad", "xyz")])
            placed.add(time, poses.position.T)
            turned.add(time, poses.rotation_vector.T)
            self.path = self.path or EveryNth(_MAX_POINTS)
            self.path.add(poses.position)
            self.rank = 1
        elif are_numbers(columns, _STATES):
            states, flags = self._same_as_before([
                _Curves(self._topic + "  motion_state", "", ["motion_state"], tuple(
                    (int(s), "%d %s" % (s, s.name.lower().replace("_", " "))) for s in MotionState), True),
                _Curves(self._topic + "  flags (0 low, 1 high)", "", _FLAGS, tuple(enumerate(_FLAGS)), True)])
            states.add(time, [columns.fields["motion_state"]])
            flags.add(time, [columns.fields[name] * 0.7 + lane for lane, name in enumerate(_FLAGS)])
            self.rank = 2

    def _add_joints(self, time: Array, columns: Columns) -> None:
        position = columns.fields.get("position")
        if position is None or position.dtype.kind not in "iuf" or position.ndim != 2 or not position.shape[1]:
            self._is_undrawable = True
        if self._is_undrawable or position is None:
            self.curves = []
            return
        labels = ["[%d]" % i for i in range(position.shape[1])]
        names = columns.fields.get("name")
        has_names = names is not None and names.dtype.kind == "S" and names.shape[1:] == (len(labels),)
        if names is not None and has_names:
            self._joints = names[0].copy() if self._joints is None and not self.curves else self._joints
            labels = [name.decode("utf-8", "replace") for name in names[0]]
        curves, = self._same_as_before([_Curves(self._topic + "  position", "rad", labels)])
        ordered: Optional[Array] = position
        if names is not None and has_names and self._joints is not None and self._joints.shape == names.shape[1:]:
            ordered = by_name(position, names, self._joints)
        elif len(curves.names) != len(labels) or has_names or self._joints is not None:
            ordered = None
        if ordered is None:
            self._is_undrawable, self.curves = True, []
            self.note = "%s is left out: the names of its joints change" % self._topic
            return
        curves.add(time, ordered.T)

    def add_field(self, time: Array, columns: Columns, name: str) -> None:
        """Add one field by its name.

        Raises:
            BagError: The field does not exist, is no number, or varies in length.
        """
        values = columns.fields.get(name)
        if values is None:
            raise BagError("%s has no field %s; there are: %s" % (self._topic, name, ", ".join(columns.fields)))
        if values.dtype.kind not in "iufb" or values.ndim > 2:
            raise BagError("%s of %s is no number" % (name, self._topic))
        table = values.reshape(len(values), -1).T.astype(float)
        labels = ["[%d]" % i for i in range(len(table))] if values.ndim > 1 else [name]
        curves, = self._same_as_before([_Curves("%s  %s" % (self._topic, name), "", labels)])
        if curves.names != tuple(labels):
            raise BagError("%s of %s is no number" % (name, self._topic))
        curves.add(time, table)


class Sketch:
    """The diagrams of a log whose messages come piece by piece; what is kept does not grow with them.

    Args:
        fields: (topic, field) to draw instead of what is known of the topics' types.
    """

    def __init__(self, fields: Sequence[Tuple[str, str]] = ()) -> None:
        self._fields = fields
        self._by_field: Dict[Tuple[str, str], _TopicSketch] = {}
        self._by_topic: Dict[str, _TopicSketch] = {}
        self._base_ns: Optional[int] = None
        self._start_ns: Optional[int] = None
        self.message_count = 0

    def forget(self, topic: str) -> None:
        """Draw nothing of a topic."""
        self._by_topic.pop(topic, None)
        for field in [field for field in self._by_field if field[0] == topic]:
            del self._by_field[field]

    def add(self, topic: str, columns: Columns) -> None:
        """Add further messages of a topic, in the order of time.

        Raises:
            BagError: A field does not exist or is no number.
        """
        if not len(columns.log_time):
            return
        self.message_count += len(columns.log_time)
        first = int(columns.log_time[0])
        self._base_ns = first if self._base_ns is None else self._base_ns
        self._start_ns = first if self._start_ns is None else min(first, self._start_ns)
        time = (columns.log_time - self._base_ns) / NS_PER_S
        if not self._fields:
            self._by_topic.setdefault(topic, _TopicSketch(topic)).add(time, columns)
        for one, name in self._fields:
            if one == topic:
                self._by_field.setdefault((topic, name), _TopicSketch(topic)).add_field(time, columns, name)

    @property
    def notes(self) -> Tuple[str, ...]:
        """A line for each topic that is left out."""
        return tuple(sketch.note for _, sketch in sorted(self._by_topic.items()) if sketch.note)

    def panels(self) -> Tuple[List[Panel], Dict[str, Array]]:
        """Return the diagrams, and the path of each topic of TCP positions, m (n, 3).

        Raises:
            BagError: There is nothing to draw.
        """
        earlier_s = ((self._start_ns or 0) - (self._base_ns or 0)) / NS_PER_S
        for topic, name in self._fields:
            if (topic, name) not in self._by_field:
                raise BagError("there is no message of %s" % topic)
        found = [self._by_field[field] for field in self._fields] or [
            sketch for _, sketch in sorted(self._by_topic.items(), key=lambda entry: (entry[1].rank, entry[0]))]
        panels = [curves.panel(earlier_s) for sketch in found for curves in sketch.curves]
        if not panels:
            raise BagError("no joints, TCP positions or states among the topics: name fields with --field TOPIC:FIELD")
        return panels, {topic: sketch.path.rows() for topic, sketch in sorted(self._by_topic.items())
                        if sketch.path is not None}


def panels_of(data: Dict[str, Columns], fields: Sequence[Tuple[str, str]] = ()) -> Tuple[
        List[Panel], Dict[str, Array]]:
    """Return the diagrams for some topics, and the path of each topic of TCP positions, m (n, 3).

    Args:
        data: Columns by topic.
        fields: (topic, field) to draw instead of those that the topics' types define.

    Raises:
        BagError: A field does not exist or is no number, or there is nothing to draw.
    """
    sketch = Sketch(fields)
    for topic, columns in data.items():
        sketch.add(topic, columns)
    return sketch.panels()


def fields_to_draw(connections: Iterable[Connection]) -> Dict[str, Container[str]]:
    """Return, for the topics that a sketch without fields of its own may draw, the fields that it needs."""
    wanted: Dict[str, Container[str]] = {}
    for connection in map(described, connections):
        if connection.datatype == JOINT_TYPE:
            wanted[connection.topic] = ("position", "name")
        elif connection.datatype in POSE_FIELDS:
            wanted[connection.topic] = POSE_FIELDS[connection.datatype]
        elif all(name in connection.definition for name in _STATES):
            wanted[connection.topic] = _STATES
    return wanted


def _draw_panel(axes: Any, panel: Panel) -> None:
    for name, time, values in panel.lines:
        axes.plot(time, values, label=name, linewidth=0.9, drawstyle="steps-post" if panel.is_steps else "default")
    axes.set_title(panel.title, fontsize=9, loc="left")
    axes.set_ylabel(panel.unit)
    if panel.ticks:
        axes.set_yticks([value for value, _ in panel.ticks])
        axes.set_yticklabels([label for _, label in panel.ticks], fontsize=7)
    axes.grid(True, linewidth=0.3)
    if len(panel.lines) > 1 and not panel.ticks:
        axes.legend(fontsize=7, loc="upper right", ncol=3)


def _draw_path(axes: Any, topic: str, points: Array) -> None:
    axes.plot(points[:, 0], points[:, 1], points[:, 2], linewidth=0.8)
    axes.scatter(*points[0], s=14, label="start")
    axes.scatter(*points[-1], s=14, marker="x", label="end")
    axes.set_xlabel("x, m")
    axes.set_ylabel("y, m")
    axes.set_zlabel("z, m")
    axes.set_title(topic + "  path", fontsize=9)
    axes.legend(fontsize=7)


def plot(data: Dict[str, Columns], target: PathLike, title: str, fields: Sequence[Tuple[str, str]] = (),
         overwrite: bool = False) -> int:
    """Draw a log; return the number of diagrams.

    Args:
        data: Columns by topic.
        target: .svg or .png by suffix.
        title: Stands above all.
        fields: See ``panels_of``.
        overwrite: Replace an existing picture.

    Raises:
        BagError: The suffix is neither, there is nothing to draw, or the output cannot be created.
        MissingDependency: matplotlib is not installed.
    """
    check_format(target)
    panels, paths = panels_of(data, fields)
    return draw(panels, target, title, paths, overwrite)


def check_format(target: PathLike) -> None:
    """Refuse a picture whose suffix no format has; raises BagError."""
    if Path(target).suffix not in FORMATS:
        raise BagError("%s: the name of a picture ends in one of %s" % (target, ", ".join(FORMATS)))


def draw(panels: Sequence[Panel], target: PathLike, title: str, paths: Mapping[str, Array],
         overwrite: bool = False) -> int:
    """Draw diagrams one below the other, and the paths of some topics; return their number.

    Args:
        panels: The diagrams.
        target: .svg or .png by suffix.
        title: Stands above all.
        paths: TCP positions by topic, m (n, 3), drawn in space below the diagrams.
        overwrite: Replace an existing picture.

    Raises:
        BagError: The output cannot be created.
        MissingDependency: matplotlib is not installed.
    """
    suffix = Path(target).suffix
    try:
        figure_module = importlib.import_module("matplotlib.figure")
        importlib.import_module("mpl_toolkits.mplot3d")
    except ImportError:
        raise MissingDependency("plot needs the Python package matplotlib") from None
    count = len(panels) + (1 if paths else 0)
    with OutputFile(target, overwrite) as output:
        figure = figure_module.Figure(figsize=(11.0, 1.0 + 2.6 * len(panels) + (5.0 if paths else 0.0)))
        grid = figure.add_gridspec(count, 1, height_ratios=[1.0] * len(panels) + ([2.0] if paths else []))
        first: Any = None
        for i, panel in enumerate(panels):
            axes = figure.add_subplot(grid[i], sharex=first)
            first = first or axes
            _draw_panel(axes, panel)
        first.figure.axes[len(panels) - 1].set_xlabel("time since the first message, s")
        if paths:
            axes = figure.add_subplot(grid[len(panels)], projection="3d")
            for topic, points in paths.items():
                _draw_path(axes, topic, points)
        figure.suptitle(title, fontsize=10)
        figure.tight_layout(rect=(0, 0, 1, 0.99))
        figure.savefig(output.file, format=suffix[1:], dpi=110)
    return count
