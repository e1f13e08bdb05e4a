"""The mutants of the motion guard in the driver's core: before a motion, and while it lasts.

``mutants.py`` puts them together with those of all other rooms.
"""
from typing import Tuple

from mutant import Mutant

PATHS = ("test/client/core/test_bad_paths.py",)
MOTIONS = ("test/client/simulated/test_motion_guard.py",)
STREAMS = ("test/client/simulated/test_servo_guard.py",)
CLEARANCES = ("test/clearance/test_motion_guard.py",)
LOOKS = ("test/client/test_long_looks.py",)
PROGRAMS = ("test/client/core/test_program_stories.py",)

OF_THE_MOTION_GUARD: Tuple[Mutant, ...] = (
    Mutant("a motion in trouble is sent", "client/core/motion_guard/motion_check.py",
           "        if trouble and self.refuses:\n", "        if False:\n", PATHS),
    Mutant("a guard that fails lets everything pass", "client/core/motion_guard/motion_check.py",
           "        return \"the motion guard has failed, so",
           "        return \"\" and \"the motion guard has failed, so",
           MOTIONS),
    Mutant("only the target of a joint move counts", "client/core/motion_guard/motion_check.py",
           "self._guard.looks([np.array((begin, end))])",
           "self._guard.looks([np.array((end, end))])", PATHS),
    Mutant("a trajectory begins that was looked at with other zones", "client/core/requests/kinds.py",
           "if self._start.workspace is not custody.motion_check.workspace:", "if False:", MOTIONS),
    Mutant("zones that were set are not kept", "client/core/procedures/zones.py",
           "    core.custody.motion_check.keep(guard)\n", "", MOTIONS),
    Mutant("a queued move is looked at from where the arm is", "client/core/move.py",
           "        self.place = place\n        self._custody = custody\n", "        self._custody = custody\n"
           "        self.place = custody.motion_check.place_of(state)\n", MOTIONS),
    Mutant("behind a refused move the way of the next one is not looked at", "client/core/move.py",
           "self.place = self._parts[-1].place if self._parts else", "self.place =",
           ("test/client/core/test_refused_parts.py",)),
    Mutant("a move to where the arm is hides a rounded corner", "client/core/motion_guard/motion_check.py",
           "start.way if is_nowhere else way", "way", ("test/client/core/test_bad_paths.py",)),
    Mutant("a limit is no end of a line", "client/core/motion_guard/line_walk.py",
           "if not low <= angle <= high:", "if False:", PATHS),
    Mutant("no place is singular", "client/core/motion_guard/line_walk.py",
           "        if slowed * _SLOWED_TO > ", "        if 0.0 * slowed > ", PATHS),
    Mutant("a tool frame of the table is the flange", "client/core/motion_guard/tool_frames.py",
           "flange_t_tool = tools[state.tool_id]", "flange_t_tool = IDENTITY", MOTIONS),
    Mutant("a stream does not look where it comes to stand", "client/core/motion_guard/frame_guard.py",
           "self._look((self.joints, joints, brake_end(self.joints, joints)))", "self._look((self.joints, joints))",
           STREAMS),
    Mutant("a stream that must brake stops at once", "client/core/motion_guard/frame_guard.py",
           "share = left / fastest if left > _ROUNDING * _STEP_CHANGE else 0.0", "share = 0.0", MOTIONS),
    Mutant("a joint target is looked at without the brake behind it", "client/core/servo_planner.py",
           "end = (brake_end(self._position, goal),) if passes else ()", "end = ()", STREAMS),
    Mutant("a pose target is looked at without the brake behind it", "client/core/servo_planner.py",
           "        if not (self._linear.passes(away) or self._angular.passes(turn)):\n", "        if True:\n",
           STREAMS),
    Mutant("no frame of a pose stream is looked at", "client/core/servo.py",
           "        return self._pose_guard.joints_of(frame.target)", "        return None, \"\"", STREAMS),
    Mutant("targets are accepted while the guard brakes", "client/core/servo.py",
           "        self._require_unbraked()\n", "", STREAMS),
    Mutant("clear space has no end", "client/core/motion_guard/clear_space.py",
           "            if not moved < self._room:", "            if False:", MOTIONS),
    Mutant("a program is not watched", "client/core/planned/program.py",
           "        trouble = self._feed_watch.trouble(state)\n", "        trouble = \"\"\n", PROGRAMS),
    Mutant("a watch forgets the time of reaction", "client/core/motion_guard/feed_watch.py",
           "    ahead = _REACTION_S + ", "    ahead = ", PROGRAMS),
    Mutant("a jog is not looked at before it begins", "client/core/requests/kinds.py",
           "        if trouble:\n            raise InvalidCommand(\"refused: where the jog",
           "        if False:\n            raise InvalidCommand(\"refused: where the jog", MOTIONS),
    Mutant("every corner is sharp", "client/core/motion_guard/line_walk.py",
           "    if beside < SHARP_M:\n", "    if True:\n", MOTIONS),
    Mutant("a look has no end", "clearance/guard.py",
           "                if work > most:\n", "                if False:\n", CLEARANCES),
    Mutant("a stop does not end the look at a move", "client/core/procedures/steps.py",
           "            yield pause(_BREATH_S)\n            check()\n", "            yield pause(_BREATH_S)\n", LOOKS),
)
