"""Procedures that load, pause and stop the controller's stored programs; each ends when its effect is seen."""
from jaka_ros_driver.client.core.arm_core import ArmCore
from jaka_ros_driver.client.core.motion import MotionOwner
from jaka_ros_driver.client.core.planned.program import SHOWN_WITHIN_S, require_program_state
from jaka_ros_driver.client.core.procedures.pausing import rests_while
from jaka_ros_driver.client.core.procedures.settings import NOT_VERIFIED, ReadBackMismatch
from jaka_ros_driver.client.core.procedures.steps import Ask, Now, Procedure, Until
from jaka_ros_driver.client.core.stillness import REST_TIME_S
from jaka_ros_driver.commands import LoadProgram, PauseMotion, Query
from jaka_ros_driver.errors import CommandRejected, InvalidCommand, MotionInterrupted, ProtocolError, StopCause
from jaka_ros_driver.state import PROGRAM_UNDER_WAY, ProgramState


def load(core: ArmCore, name: str) -> Procedure:
    """Load the named program; run it exclusively. Return a sentence for the user.

    Raises:
        InvalidCommand: A program runs or is paused, or this is no name of a program; nothing was sent.
        ReadBackMismatch: The controller accepted it and holds another one.
        JakaError: As ``Ask``.
    """
    command = core.audited(LoadProgram(name))
    state = core.fresh_state((yield Now()))
    if state.program_state is not None:
        require_program_state(state, ProgramState.IDLE)
    yield Ask(command)
    try:
        held = yield Ask(Query.LOADED_PROGRAM)
    except (CommandRejected, ProtocolError):
        return "program %s loaded%s" % (name, NOT_VERIFIED)
    if _stem(held) != _stem(name):
        raise ReadBackMismatch("the controller accepted program %r but holds %.100r" % (name, held))
    return "program %s loaded" % name


def pause(core: ArmCore) -> Procedure:
    """Hold the running program, also one of the pendant's; return when the arm rests and the feed shows it paused.

    Raises:
        InvalidCommand: None runs, or it has ended meanwhile.
        MotionInterrupted: It was not seen paused in time; it may go on.
        JakaError: As ``Ask``.
    """
    _require_no_other_motion(core)
    require_program_state(core.fresh_state((yield Now())), *PROGRAM_UNDER_WAY)
    yield Ask(PauseMotion())
    since = yield Now()

    def is_held() -> bool:
        state = core.state
        if state is None or state.received_at <= since:
            return False
        if state.program_state == ProgramState.IDLE:
            raise InvalidCommand("refused: the program has ended, it cannot be paused")
        return state.program_state == ProgramState.PAUSED
    if not (yield Until(rests_while(core, is_held, REST_TIME_S), SHOWN_WITHIN_S)):
        raise MotionInterrupted(StopCause.TIMEOUT, "the program was not seen paused within %.0f s" % SHOWN_WITHIN_S)
    return "the program is paused; resume goes on, stop ends it"


def see_stopped(core: ArmCore) -> Procedure:
    """Wait after a stop until no program runs and the arm rests.

    Raises:
        MotionInterrupted: That was not seen in time.
    """
    since = yield Now()

    def is_over() -> bool:
        state = core.state
        return (state is not None and state.received_at > since
                and state.program_state in (None, ProgramState.IDLE))
    if not (yield Until(rests_while(core, is_over, REST_TIME_S), SHOWN_WITHIN_S)):
        raise MotionInterrupted(StopCause.TIMEOUT, "the stop was accepted, and within %.0f s the program was not seen "
                                                   "idle with the arm at rest" % SHOWN_WITHIN_S)
    return "no program runs, the arm rests"


def _require_no_other_motion(core: ArmCore) -> None:
    owner = core.motion_owner
    if owner is not None and owner is not MotionOwner.PROGRAM:
        raise InvalidCommand("refused: no program runs, %s owns the arm's motion" % owner.value)


def _stem(name: str) -> str:
    """Return a program's name without its suffix.

    Sources disagree on the suffix (docs/controller-protocol.md section 5.14).
    """
    return name[:-4] if name.endswith((".ngc", ".jks")) else name
