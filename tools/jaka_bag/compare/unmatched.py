"""The names in tolerances that a golden log lacks: a limit below a misspelt name limits nothing."""
import difflib
from typing import Collection, Dict, List, Mapping, Set, Tuple

from .runs.run import LongTrack, Run
from .tolerances import Tolerances

_POSE_NAMES = ("position", "orientation")


def unmatched_names(golden: Run, tolerances: Tolerances) -> Tuple[str, ...]:
    """Return a line for each joint, topic and field of ``per_joint``, ``fields`` and ``envelopes`` that is not there.

    Patterns are left out: what one ought to leave out and does not is compared, which shows by itself.

    Args:
        golden: The golden log, read with these tolerances.
        tolerances: Tolerances of the comparison.
    """
    joints = {name for track in golden.joints.values() for name in track.names}
    lines = ["joints.per_joint: %s" % _lacks("joint", name, joints)
             for name in tolerances.joints.per_joint if name not in joints]
    fields = {topic: set(found) for topic, found in golden.fields.items()}
    limited = _limited(golden)
    return (*lines, *_by_topic("fields", tolerances.fields, fields), *_by_topic(
        "envelopes", tolerances.envelopes, limited))


def _limited(golden: Run) -> Dict[str, Set[str]]:
    """Return the names that may have an envelope, by topic."""
    found: Dict[str, Set[str]] = {topic: set(track.names) for topic, track in golden.joints.items()}
    for topic in golden.poses:
        found.setdefault(topic, set()).update(_POSE_NAMES)
    for topic, tracks in golden.fields.items():
        for name, track in tracks.items():
            found.setdefault(topic, set()).update(_parts(name, track))
    return found


def _parts(name: str, track: LongTrack) -> List[str]:
    return [name, *["%s[%d]" % (name, column) for column in range(len(track.names))]]


def _by_topic(section: str, given: Mapping[str, Mapping[str, object]], known: Dict[str, Set[str]]) -> List[str]:
    lines: List[str] = []
    for topic, names in given.items():
        if topic not in known:
            lines.append("%s: %s" % (section, _lacks("topic", topic, known)))
            continue
        lines += ["%s: %s: %s" % (section, topic, _lacks("name", name, known[topic]))
                  for name in names if name not in known[topic]]
    return lines


def _lacks(kind: str, name: str, known: Collection[str]) -> str:
    near = difflib.get_close_matches(name, sorted(known), 1)
    return "the golden log has no %s %r%s" % (kind, name, "; did you mean %r?" % near[0] if near else "")
