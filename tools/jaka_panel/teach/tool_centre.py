"""The tip of a tool by poses of the flange in which it touches one place: four or more, least squares."""
import math
from typing import List, NamedTuple, Sequence

import numpy as np

from .rotations import Array, rotation_matrix
from .user_frame import MOST_M, CannotTeach

LEAST_POSES, MOST_POSES = 4, 20
"""Fewest poses that determine a tip and show an error, and most: a person takes them one by one."""
LEAST_TURN_RAD = math.radians(5.0)
"""Least turn between two of the poses."""
LEAST_SPREAD = 0.1
"""Least share of a shift of the tip that the poses show, in the direction in which they show it least."""
FARTHEST_M = 2.0
"""Farthest tip of a tool from the flange, m: no arm carries one so long, so poses were mixed up."""
MOST_RAD = 100.0
"""Largest part of a rotation vector, rad, that is taken: one beyond it is none."""


class TaughtTool(NamedTuple):
    """A tool's tip.

    Attributes:
        position: Tip in the flange, m, (3,).
        place: The place that it touches, in the base, m, (3,).
        residual: Largest distance of the tip from that place in one of the poses, m.
        worst: Number of that pose, from 1 on.
        uncertainty: Standard deviation of ``position``, as far as the poses show it, m.
    """

    position: List[float]
    place: List[float]
    residual: float
    worst: int
    uncertainty: float


def tool_centre(positions: Sequence[Sequence[float]], rotation_vectors: Sequence[Sequence[float]]) -> TaughtTool:
    """Return the tip that is at one place in all poses of the flange, as near as can be.

    Args:
        positions: Of the flange in the base, m, (4 to 20, 3).
        rotation_vectors: Its orientations in the base, rad, (4 to 20, 3).

    Raises:
        CannotTeach: There are too few poses, their orientations are too alike, or no tool has such a tip.
    """
    p, r = np.asarray(positions, dtype=float), np.asarray(rotation_vectors, dtype=float)
    if p.shape != r.shape or p.ndim != 2 or p.shape[1] != 3 or not LEAST_POSES <= len(p) <= MOST_POSES:
        raise CannotTeach("%d to %d poses are needed" % (LEAST_POSES, MOST_POSES))
    if not ((np.abs(p) <= MOST_M).all() and (np.abs(r) <= MOST_RAD).all()):
        raise CannotTeach("every pose needs six numbers, within %g m and %g rad" % (MOST_M, MOST_RAD))
    turns = np.array([rotation_matrix(vector) for vector in r])
    _require_turns(turns)
    # turns[i] @ tip + p[i] = place for all i; without the place: (turns[i] - mean) @ tip = mean(p) - p[i]
    a = (turns - turns.mean(axis=0)).reshape(-1, 3)
    tip, _, _, singular = np.linalg.lstsq(a, (p.mean(axis=0) - p).reshape(-1), rcond=None)
    spread = float(singular[-1]) / math.sqrt(len(p))
    if spread < LEAST_SPREAD:
        raise CannotTeach("the orientations are too alike, or turned about one axis alone: an error of the tip is seen "
                          "with %.0f %% in one direction, and %.0f %% are needed; tilt the tool to several sides" % (
                              100.0 * spread, 100.0 * LEAST_SPREAD))
    places = turns @ tip + p
    place = places.mean(axis=0)
    errors = np.linalg.norm(places - place, axis=1)
    if float(np.linalg.norm(tip)) > FARTHEST_M:
        raise CannotTeach("the tip would be %.2f m from the flange: it did not touch one place" % np.linalg.norm(tip))
    freedom = 3 * len(p) - 6
    variance = float(((places - place) ** 2).sum()) / freedom
    uncertainty = math.sqrt(variance * float(np.trace(np.linalg.inv(a.T @ a))))
    return TaughtTool(tip.tolist(), place.tolist(), float(errors.max()), int(np.argmax(errors)) + 1, uncertainty)


def _require_turns(turns: Array) -> None:
    """Require that no two poses have almost the same orientation; raise CannotTeach."""
    for one in range(len(turns)):
        for other in range(one + 1, len(turns)):
            cosine = 0.5 * (float(np.trace(turns[one].T @ turns[other])) - 1.0)
            angle = math.acos(max(-1.0, min(1.0, cosine)))
            if angle < LEAST_TURN_RAD:
                raise CannotTeach("poses %d and %d have almost the same orientation: %.1f degrees apart, and %g are "
                                  "needed" % (one + 1, other + 1, math.degrees(angle), math.degrees(LEAST_TURN_RAD)))
