"""Inverse kinematics: flange pose to joint angles, every branch or the one nearest to a reference.

The main family and MiniCobo are solved in closed form (``closed_forms``), the A12 by a one-dimensional search
(``numeric_inverse``; experimental). An arm whose own DH file deviates from its family's structure is solved for the
structure and then refined on the real table.

A target has a solution where the arm reaches it within ``POSITION_TOLERANCE`` and ``ROTATION_TOLERANCE``. Away from
singularities a solution is exact to rounding.
"""
import math
from typing import List, Optional, Sequence, Tuple

from jaka_ros_driver.errors import PoseOutsideLimits, UnreachablePose
from jaka_ros_driver.kinematics import closed_forms, numeric_inverse
from jaka_ros_driver.kinematics.arm_models import SPHERICAL_WRIST, THREE_PARALLEL, ArmModel
from jaka_ros_driver.kinematics.forward import forward, singularity_measures
from jaka_ros_driver.kinematics.rotations import Transform, distance_between, rotation_angle_between, wrap_angle
from jaka_ros_driver.state import Vector
from jaka_ros_driver.units import rad_to_deg

POSITION_TOLERANCE = 2e-6
"""Largest position error, m, of a solution for a target at a singularity or at the edge of the reach."""
ROTATION_TOLERANCE = 2e-6
"""Largest rotation error, rad, of such a solution."""
LIMIT_TOLERANCE = 1e-9
"""Largest excess, rad, of a joint over its limit that is clamped to the limit."""

_NEAR_REFERENCE = 0.05
"""Largest difference, rad, of any joint from the reference up to which an iterative solution counts as the nearest."""
_NEAR_STRETCHED = 0.25
"""Elbow measure (dimensionless) below which a table that is some mm beside its structure can have other branches."""
_NEAR_SINGULAR = 0.02
"""Singularity measure (dimensionless; shoulder in m) below which rounding of the pose can move the branches far."""


def inverse_all(model: ArmModel, base_t_flange: Transform, reference: Optional[Sequence[float]] = None) -> List[Vector]:
    """Return every branch that reaches the pose, each joint in (-pi, pi], rad; joint limits are not checked.

    Where the pose leaves q6 free (sin q5 = 0), that of ``reference``, rad (6,), is used, 0 without one; in the main
    family that nearest to it with which the arm reaches.
    """
    return _branches(model, base_t_flange, reference)[0]


def inverse(model: ArmModel, base_t_flange: Transform, reference: Sequence[float]) -> Vector:
    """Return the joint angles within the limits, rad (6,), that reach the pose and are nearest to the reference.

    Branch and whole turns of each joint are chosen for the smallest sum of squared joint differences. At a singularity,
    where rounding of the pose can move the branches far from the reference, a solution next to the reference that
    reaches the pose within the tolerances is preferred where it is nearer.

    Args:
        model: The arm.
        base_t_flange: The target; its rotation must be orthonormal.
        reference: Joint angles, rad, shape (6,).

    Raises:
        UnreachablePose: The pose is out of reach.
        PoseOutsideLimits: Every branch breaks a joint limit; the message says which.
    """
    if not model.has_closed_form:
        followed = numeric_inverse.refine(model, base_t_flange, reference)
        if followed is not None and _is_near(model, followed, reference):
            return followed
    branches, obstacle = _branches(model, base_t_flange, reference)
    best: Optional[Vector] = None
    best_cost = math.inf
    for branch in branches:
        cost = 0.0
        turned = []
        for angle, near, (low, high) in zip(branch, reference, model.joint_limits):
            if not -math.pi <= angle - near <= math.pi:
                angle += math.tau * round((near - angle) / math.tau)
            if not low <= angle <= high:
                angle = _turned_into(angle, low, high)
            cost += (angle - near) ** 2
            if not cost < best_cost:
                break
            turned.append(angle)
        else:
            best, best_cost = tuple(turned), cost
    if not model.is_exact and (best is None or abs(singularity_measures(model, reference).elbow) < _NEAR_STRETCHED):
        best = _followed(model, base_t_flange, tuple(reference), best)
    elif best_cost > _NEAR_REFERENCE ** 2 and min(singularity_measures(model, reference)) < _NEAR_SINGULAR:
        followed = numeric_inverse.settle(model, base_t_flange, reference)
        if (_is_near(model, followed, reference) and math.dist(followed, reference) ** 2 < best_cost
                and _reaches(model, followed, base_t_flange)):
            return followed
    if best is not None:
        return best
    if branches:
        raise PoseOutsideLimits(_outside_limits(model, branches))
    raise UnreachablePose(obstacle)


def _followed(model: ArmModel, target: Transform, reference: Vector, best: Optional[Vector]) -> Optional[Vector]:
    """Return the nearest joints within the limits, rad (6,), of ``best`` and what is found from the reference itself.

    Beside a stretched elbow the structure's branches, from which the real table's are refined, may be none, or may all
    lead to one side of the elbow; so the second search begins on the other side of what the first one found.
    """
    for is_mirrored in (False, True):
        start = reference if not is_mirrored or best is None else _on_other_side(model, best)
        for follow in (numeric_inverse.refine, numeric_inverse.settle):
            found = follow(model, target, start)
            if found is None or not _reaches(model, found, target):
                continue
            turned = tuple([angle - math.tau * round((angle - near) / math.tau)
                            for angle, near in zip(found, reference)])
            is_nearer = best is None or math.dist(turned, reference) < math.dist(best, reference)
            if is_nearer and all(low <= angle <= high for angle, (low, high) in zip(turned, model.joint_limits)):
                best = turned
    return best


def _on_other_side(model: ArmModel, joints: Vector) -> Vector:
    """Return joints, rad (6,), with the elbow on the other side, for arms whose upper arm is as long as the forearm."""
    q1, q2, q3, q4, q5, q6 = joints
    elbow = q3 + model.dh[2].theta_offset
    return q1, q2 + elbow, q3 - 2.0 * elbow, q4 + elbow, q5, q6


def _branches(model: ArmModel, target: Transform, reference: Optional[Sequence[float]]) -> Tuple[List[Vector], str]:
    offsets = [row.theta_offset for row in model.dh]
    free_q6 = reference[5] + offsets[5] if reference is not None else offsets[5]
    if model.family == THREE_PARALLEL:
        solved = closed_forms.three_parallel(model.structural_dh, target, free_q6)
    elif model.family == SPHERICAL_WRIST:
        solved = closed_forms.spherical_wrist(model.structural_dh, target, free_q6)
    else:
        solved = numeric_inverse.two_parallel(model.structural_dh, target)
    o1, o2, o3, o4, o5, o6 = offsets
    branches: List[Vector] = [
        (wrap_angle(q1 - o1), wrap_angle(q2 - o2), wrap_angle(q3 - o3),
         wrap_angle(q4 - o4), wrap_angle(q5 - o5), wrap_angle(q6 - o6)) for q1, q2, q3, q4, q5, q6 in solved.angles]
    if not model.is_exact:
        branches = numeric_inverse.refine_all(model, target, branches)
    elif solved.is_clamped:
        branches = [branch for branch in branches if _reaches(model, branch, target)]
    return branches, solved.obstacle or "out of reach: no joint position brings the flange there"


def _reaches(model: ArmModel, joint_position: Sequence[float], target: Transform) -> bool:
    reached = forward(model, joint_position)
    return (distance_between(reached, target) <= POSITION_TOLERANCE
            and rotation_angle_between(reached, target) <= ROTATION_TOLERANCE)


def _turned_into(angle: float, low: float, high: float) -> float:
    """Return the angle, rad, turned by the fewest whole turns into low..high; infinite where no turn fits."""
    if angle < low:
        angle += math.tau * math.ceil((low - LIMIT_TOLERANCE - angle) / math.tau)
    else:
        angle -= math.tau * math.ceil((angle - high - LIMIT_TOLERANCE) / math.tau)
    if not low - LIMIT_TOLERANCE <= angle <= high + LIMIT_TOLERANCE:
        return math.inf
    return min(max(angle, low), high)


def _is_near(model: ArmModel, joint_position: Vector, reference: Sequence[float]) -> bool:
    return all(abs(angle - near) < _NEAR_REFERENCE and low <= angle <= high
               for angle, near, (low, high) in zip(joint_position, reference, model.joint_limits))


def _outside_limits(model: ArmModel, branches: Sequence[Vector]) -> str:
    """Return a text that names the joints outside their limits, of the branch that has the fewest."""
    def outside(branch: Vector) -> List[str]:
        return ["joint %d at %.6g rad (%.4g deg), limits %.4g to %.4g deg"
                % (n + 1, angle, rad_to_deg(angle), rad_to_deg(low), rad_to_deg(high))
                for n, (angle, (low, high)) in enumerate(zip(branch, model.joint_limits))
                if all(not low <= angle + turn * math.tau <= high for turn in (-1, 0, 1))]
    nearest = sorted((outside(branch) for branch in branches), key=len)[0]
    return "outside the joint limits: it would need " + "; ".join(nearest)
