"""The mutants of the guard of motions: of its shapes, its zones, and how it follows a path."""
from typing import Tuple

from mutant import Mutant

GUARD = ("test/clearance/test_motion_guard.py",)
SHAPE = ("test/clearance/test_shape.py",)
WORKSPACE = ("test/clearance/test_workspace.py",)
DISTANCES = ("test/clearance/test_distances.py",)
URDF = ("test/clearance/test_collision_urdf.py",)

CORNERS = ("test/client/simulated/test_joint_corners.py",)

OF_CLEARANCE: Tuple[Mutant, ...] = (
    Mutant("the rounded corners of joint moves are not looked at", "client/core/motion_guard/motion_check.py",
           "        elif start.way is not None:", "        elif False:", CORNERS),
    Mutant("a corner of joints is rounded as far as its ways let it", "client/core/motion_guard/joint_corner.py",
           "if beside(longest) > before.tolerance:", "if False:", CORNERS),
    Mutant("a corner of joints is looked at by its ends", "client/core/motion_guard/joint_corner.py",
           "return [_on_parabola(first, last, corner, k / count) for k in range(count + 1)]",
           "return [first, last]", CORNERS),
    Mutant("a corner of joints leaves its line too late", "client/core/motion_guard/joint_corner.py",
           "(share - begin) / (end - begin)", "0.0", CORNERS),
    Mutant("a path is judged by its ends", "clearance/guard.py",
           "                share = min(1.0, share + step)", "                share = 1.0", GUARD),
    Mutant("an arm in trouble may go deeper", "clearance/guard.py",
           "floors = np.minimum(self._margin, gaps - _SAME)", "floors = np.minimum(self._margin, gaps - 1.0)", GUARD),
    Mutant("an arm in trouble may not move out", "clearance/guard.py",
           "floors = np.minimum(self._margin, gaps - _SAME)", "floors = np.full(len(gaps), self._margin)", GUARD),
    Mutant("an arm that has moved out may go back in", "clearance/guard.py",
           "floors = [max(floor, min(self._margin, gap - _SAME)) for floor, gap in zip(floors, gaps)]",
           "floors = list(floors)", GUARD),
    Mutant("free way is not used up from segment to segment", "clearance/guard.py",
           "slacks = [slack - rest * speed for slack, speed in zip(slacks, approach)]",
           "slacks = list(slacks)", GUARD),
    Mutant("the bound of a joint's motion leaves out the links between", "clearance/guard.py",
           "turned = abs(a) + far", "turned = abs(a)", GUARD),
    Mutant("a joint position that is no number is clear", "clearance/guard.py",
           "if not math.isfinite(sum(joints)):", "if False:", GUARD),
    Mutant("a part far from another has no distance to its zones", "clearance/guard.py",
           "- half - radius", "+ half - radius", GUARD),
    Mutant("a keep-in box keeps one end of a part in", "clearance/guard.py",
           "return -max(signed(*p), signed(*q)) - radius", "return -min(signed(*p), signed(*q)) - radius", GUARD),
    Mutant("the end of a segment is where its line goes on", "clearance/distances.py",
           "                t = 1.0\n                s = min(1.0, max(0.0, (b - c) / a))", "                pass",
           DISTANCES),
    Mutant("a file in mm is taken", "clearance/workspace.py",
           "COORDINATE_LIMIT = 10.0", "COORDINATE_LIMIT = 10000.0", WORKSPACE),
    Mutant("the flange reaches beyond its face", "clearance/shape.py",
           "Capsule(\"the flange\", 6, (0.0, 0.0, -d6), (0.0, 0.0, -link), link)",
           "Capsule(\"the flange\", 6, (0.0, 0.0, -d6), (0.0, 0.0, 0.0), link)", SHAPE),
    Mutant("the URDF's cylinders lie across", "clearance/solids.py",
           "math.atan2(math.hypot(x, y), z), math.atan2(y, x)", "math.atan2(z, math.hypot(x, y)), math.atan2(y, x)",
           URDF),
)
