"""The steps of the stage that moves for which a person does something at the pendant."""
from typing import Optional

from jaka_ros_driver.commands import JointMove, PlayProgram, Query, Stop
from jaka_ros_driver.probe.ask import code_of
from jaka_ros_driver.probe.facts import Fact
from jaka_ros_driver.probe.motion import MotionEnded
from jaka_ros_driver.probe.moving import ACCELERATION, NEAR, SLOW, MoveStep, Moving, come_back
from jaka_ros_driver.probe.person import Person
from jaka_ros_driver.probe.set_same import PrintLine, StageEnded
from jaka_ros_driver.state import ProgramState

_SHOWN_S = 3.0
"""Longest wait, s, for the feed to show what was done at the pendant."""
_REFUSED, _SDK_NOT_ENABLED = "2", "-7"
_BEGINS_S, _RUNS_S, _ENDS_S = 5.0, 2.0, 2.0
"""Longest wait, s, for a program to begin; for how long it must run, s; longest wait, s, for its end after a stop."""
_SUFFIXES = (".ngc", ".jks")
_RUNS_ON = "the program that was played may run on: end it at the pendant"


# ---- a program that runs ----

def _program(it: Moving) -> None:
    if _stem(it.told(Query.LOADED_PROGRAM)) != _stem(it.program):
        raise MotionEnded("the program that is loaded is not that of --program")
    begun = it.arm.state.joint_position

    def runs() -> bool:
        """Ask whether the program runs; raise MotionEnded where it moves the arm."""
        if max(abs(a - b) for a, b in zip(it.arm.state.joint_position, begun)) > NEAR:
            raise MotionEnded("the program moved the arm")
        return _state(it) is ProgramState.RUNNING
    it.arm.back.left.append(_RUNS_ON)
    it.arm.require(PlayProgram())
    if not it.arm.wait(_BEGINS_S, runs):
        raise MotionEnded("the program was not seen to run within %.0f s" % _BEGINS_S)
    if it.arm.wait(_RUNS_S, lambda: not runs()):
        raise MotionEnded("the program ended by itself within %.0f s" % _RUNS_S)
    it.arm.require(Stop())
    it.arm.wait(_ENDS_S, lambda: not runs())
    it.facts["stop_ends_program"] = program_fact(_state(it))


def _state(it: Moving) -> ProgramState:
    """Ask for the state of the program, and note that it runs on, or does not."""
    state: ProgramState = it.told(Query.PROGRAM_STATE)
    if state is ProgramState.IDLE and _RUNS_ON in it.arm.back.left:
        it.arm.back.left.remove(_RUNS_ON)
    return state


def _note_state(it: Moving) -> None:
    _state(it)


def program_fact(state: ProgramState) -> Fact:
    """Return what the state of a program, a moment after ``stop_program``, says of that."""
    how = "a program that ran was %s within %.0f s after stop_program" % (state.name.lower(), _ENDS_S)
    return Fact({ProgramState.IDLE: True, ProgramState.RUNNING: False}.get(state), how)


def _stem(name: str) -> str:
    return next((name[:-len(suffix)] for suffix in _SUFFIXES if name.endswith(suffix)), name)


def _end_program(it: Moving, person: Person, tell: PrintLine) -> None:
    """Have the person end a program that runs on."""
    if _RUNS_ON in it.arm.back.left:
        it.arm.run(lambda: _note_state(it))
    if _RUNS_ON in it.arm.back.left:
        person.ask("the program may run on. End it at the pendant; y goes on: ", it.arm.idle)
        it.arm.run(lambda: _note_state(it))
    if _RUNS_ON in it.arm.back.left:
        raise StageEnded(_RUNS_ON)
    come_back(it, person, tell)


PROGRAM = MoveStep(
    "plays the program of --program, which must be loaded and only wait for 10 s or longer, and sends stop_program "
    "after 2 s: does that end it? A program that moves the arm is stopped at once", ("stop_ends_program",), _program,
    finish=_end_program)
PROGRAM_MOVES = ("get_loaded_program", "play_program", "get_program_state")
"""Commands of the step that is made only where a program is named."""


# ---- an arm that is not enabled ----

def _without_drives(it: Moving) -> None:
    it.arm.needs_drives = False


def _not_enabled(it: Moving) -> None:
    if not it.arm.wait(_SHOWN_S, lambda: not it.arm.state.is_enabled):
        raise MotionEnded("the arm was enabled still")
    state = it.arm.state
    if not state.is_powered or state.emergency_stop or state.protective_stop:
        raise MotionEnded("the arm was stopped or without power, too, so that the code may be that for this")
    reply = it.arm.ask(JointMove(state.joint_position, SLOW, ACCELERATION))
    it.facts["unready_code"] = unready_fact(None if reply is None else code_of(reply))


def unready_fact(code: Optional[str]) -> Fact:
    """Return what the code of the reply to a move says, of an arm that is not enabled; None where no reply came."""
    how = "joint_move to where it is, not enabled, was %s" % (
        "not answered" if code is None else "accepted" if code == "0" else "refused with code %s" % code)
    return Fact({_REFUSED: "2", _SDK_NOT_ENABLED: "sdk"}.get(code or ""), how)


def _leave_disabled(it: Moving, person: Person, tell: PrintLine) -> None:
    tell("the arm is as it was left at the pendant: enable it there when it is to move")


NOT_ENABLED = MoveStep(
    "sends a move to where it is while the arm is not enabled: how is that refused?", ("unready_code",), _not_enabled,
    "disable the arm at the pendant, and leave its power on.", _without_drives, _leave_disabled)
