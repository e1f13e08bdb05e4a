"""Pictures of a state log: joints, TCP position and path, states over time (SVG or PNG, by matplotlib)."""
import importlib
from pathlib import Path
from typing import Any, Dict, List, Mapping, NamedTuple, Sequence, Tuple

import numpy as np

from ..driver_interface import MotionState
from ..errors import BagError, MissingDependency
from ..messages.batch import Array
from ..messages.columns import Columns
from ..output_file import OutputFile
from ..paths import PathLike
from ..units import NS_PER_S
from .tool_poses import ToolPoses, tool_poses

FORMATS = (".svg", ".png")
_MAX_POINTS = 4000
_FLAGS = ("power_state", "servo_state", "collision_state")


class Panel(NamedTuple):
    """One diagram: its title, the label of its vertical axis, and lines (name, time in s, values)."""

    title: str
    unit: str
    lines: Tuple[Tuple[str, Array, Array], ...]
    is_steps: bool = False
    ticks: Tuple[Tuple[int, str], ...] = ()


def thin(time: Array, values: Array, limit: int = _MAX_POINTS) -> Tuple[Array, Array]:
    """At most about ``limit`` points that show the same curve: smallest and largest value of each stretch."""
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


def _changes(time: Array, values: Array) -> Tuple[Array, Array]:
    """Only the first and last sample of each run of equal values."""
    differs = np.flatnonzero(np.diff(values)) if len(values) else np.zeros(0, np.int64)
    which = np.unique(np.concatenate([[0], differs, differs + 1, [max(len(values) - 1, 0)]]))
    return time[which], values[which]


def _seconds(columns: Columns, start_ns: int) -> Array:
    return (columns.log_time - start_ns) / NS_PER_S


def _joint_panels(topic: str, columns: Columns, start_ns: int) -> List[Panel]:
    position = columns.fields.get("position")
    if position is None or position.dtype == object or position.ndim != 2 or not position.shape[1]:
        return []
    labels = ["[%d]" % i for i in range(position.shape[1])]
    names = columns.fields.get("name")
    if names is not None and names.dtype != object and names.shape[1] == len(labels):
        labels = [name.decode("utf-8", "replace") for name in names[0]]
    time = _seconds(columns, start_ns)
    lines = tuple((label, *thin(time, position[:, i])) for i, label in enumerate(labels))
    return [Panel(topic + "  position", "rad", lines)]


def _tcp_panels(topic: str, columns: Columns, poses: ToolPoses, start_ns: int) -> List[Panel]:
    time = _seconds(columns, start_ns)
    panels = []
    for values, title, unit in ((poses.position, "position", "m"), (poses.rotation_vector, "rotation vector", "rad")):
        lines = tuple((axis, *thin(time, values[:, i])) for i, axis in enumerate("xyz"))
        panels.append(Panel("%s  %s" % (topic, title), unit, lines))
    return panels


def _state_panels(topic: str, columns: Columns, start_ns: int) -> List[Panel]:
    time = _seconds(columns, start_ns)
    lanes = []
    for lane, name in enumerate(_FLAGS):
        at, values = _changes(time, columns.fields[name])
        lanes.append((name, at, values * 0.7 + lane))
    return [
        Panel(topic + "  motion_state", "", (("motion_state", *_changes(time, columns.fields["motion_state"])),), True,
              tuple((int(s), "%d %s" % (s, s.name.lower().replace("_", " "))) for s in MotionState)),
        Panel(topic + "  flags (0 low, 1 high)", "", tuple(lanes), True, tuple(enumerate(_FLAGS)))]


def _field_panel(topic: str, columns: Columns, name: str, start_ns: int) -> Panel:
    values = columns.fields.get(name)
    if values is None:
        raise BagError("%s has no field %s; there are: %s" % (topic, name, ", ".join(columns.fields)))
    if values.dtype.kind not in "iufb" or values.ndim > 2:
        raise BagError("%s of %s is no number" % (name, topic))
    time = _seconds(columns, start_ns)
    table = values.reshape(len(values), -1)
    lines = tuple(("[%d]" % i if values.ndim > 1 else name, *thin(time, table[:, i])) for i in range(table.shape[1]))
    return Panel("%s  %s" % (topic, name), "", lines)


def panels_of(data: Dict[str, Columns], fields: Sequence[Tuple[str, str]] = ()) -> Tuple[
        List[Panel], Dict[str, Array]]:
    """The diagrams for some topics, and the path of each topic of TCP positions, m (n, 3).

    Args:
        data: Columns by topic.
        fields: (topic, field) to draw instead of what is known of the topics' types.

    Raises:
        BagError: A field does not exist or is no number, or there is nothing to draw.
    """
    start_ns = min((int(columns.log_time[0]) for columns in data.values()), default=0)
    if fields:
        for topic, _ in fields:
            if topic not in data:
                raise BagError("there is no message of %s" % topic)
        return [_field_panel(topic, data[topic], name, start_ns) for topic, name in fields], {}
    joints: List[Panel] = []
    positions: List[Panel] = []
    states: List[Panel] = []
    paths: Dict[str, Array] = {}
    for topic, columns in sorted(data.items()):
        poses = tool_poses(columns)
        if columns.connection.datatype == "sensor_msgs/JointState":
            joints += _joint_panels(topic, columns, start_ns)
        elif poses is not None:
            positions += _tcp_panels(topic, columns, poses, start_ns)
            paths[topic] = poses.position
        elif all(name in columns.fields for name in ("motion_state",) + _FLAGS):
            states += _state_panels(topic, columns, start_ns)
    if not joints + positions + states:
        raise BagError("no joints, TCP positions or states among the topics: name fields with --field TOPIC:FIELD")
    return joints + positions + states, paths


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
    if len(points) > _MAX_POINTS:
        points = points[np.linspace(0, len(points) - 1, _MAX_POINTS).astype(np.int64)]
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
    """Draw a log; give the number of diagrams.

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
    """Draw diagrams one below the other, and the paths of some topics; give their number.

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
