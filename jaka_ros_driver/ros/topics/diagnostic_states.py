"""The states that the diagnostics show, each with its meaning and what is to be done.

The table in docs/operation.md is the output of ``python3 -m jaka_ros_driver.ros.topics.diagnostic_states``.
"""
from typing import Dict, NamedTuple, Optional, Tuple

OK, WARN, ERROR, STALE = range(4)
"""Levels of diagnostic_msgs/DiagnosticStatus."""
_NAMES = ("OK", "WARN", "ERROR", "STALE")
NOTHING = "nothing"
NO_STATES = "connected, but no states come"


class ShownState(NamedTuple):
    """One state of one check.

    Attributes:
        check: The check's name; "" for every check.
        level: Its level.
        words: A part of its message; "" for every other message of this level.
        meaning: What is so.
        remedy: What a person does.
    """

    check: str
    level: int
    words: str
    meaning: str
    remedy: str


_TABLE: Dict[str, Tuple[Tuple[int, str, str, str], ...]] = {
    "controller link": (
        (OK, "up", "both ports are connected and states come", NOTHING),
        (WARN, "connected anew", "the link was lost for a while", "look for a loose cable if it comes again"),
        (ERROR, NO_STATES, "both ports are connected, the controller sends nothing that can be used",
         "see status feed; is the controller still starting, or its feed switched off? restart it"),
        (ERROR, "down: ", "a port is not connected, for the reason that is named",
         "power, cable, address ~ip; another client that holds a controller of one client"),
    ),
    "arm": (
        (OK, "not known yet", "no controller was asked yet", "see controller link"),
        (WARN, "SIMULATED", "no real arm moves", "for a real arm: start with ip:=ADDRESS"),
        (OK, "real", "a real arm moves", NOTHING),
    ),
    "guard": (
        (OK, "watches", "a dying driver does not leave the arm moving", NOTHING),
        (WARN, "switched off", "~guard is false", "start with guard:=true"),
        (WARN, "was replaced", "the guard had died or hung", "look at the computer's load and memory"),
        (ERROR, "does not answer", "a dying driver leaves the arm moving for now",
         "wait 10 s for the next one; then look at memory and load, restart the driver"),
    ),
    "custody": (
        (OK, "nobody moves", "the arm rests, or moves by hand", NOTHING),
        (OK, "", "this driver moves the arm, by what is named", NOTHING),
        (WARN, "", "the arm moves and not by this driver", "find who moves it: pendant, program, another client"),
    ),
    "status feed": (
        (OK, " Hz", "states come in time", NOTHING),
        (STALE, "no state yet", "no usable state has come since the start",
         "see controller link; is the status port ~status_port right?"),
        (STALE, "no fresh state", "the states have stopped", "see controller link; is the network busy?"),
        (WARN, "damaged frames", "frames were cut or wrong, and were left out", "check cable and network"),
        (WARN, "slow: ", "fewer states come than ~publish_rate", "check network and load; lower ~publish_rate"),
        (WARN, "jitter ", "states come irregularly", "check load of the computer and network"),
    ),
    "controller state": (
        (OK, "", "the arm can move, or moves", NOTHING),
        (WARN, "cannot move", "what is named is missing for a motion", "do what is named, in this order"),
        (ERROR, "event ", "the controller has a fault", "remove its cause, then call clear_err or recover"),
    ),
    "emergency stop": (
        (OK, "released", "no emergency stop", NOTHING),
        (ERROR, "pressed", "the emergency stop is pressed", "make it safe, release it, then call recover"),
    ),
    "protective stop": (
        (OK, "none", "no protective stop", NOTHING),
        (ERROR, "stands", "the arm has hit something or a safety input is open",
         "free the arm, close the input, then call clear_err or recover"),
    ),
    "soft limit": (
        (OK, "none", "no joint at a soft limit", NOTHING),
        (WARN, "a joint stands", "a joint stands at its soft limit", "jog it away from the limit"),
    ),
    "temperature": (
        (OK, "", "no part is hot, or none is reported", NOTHING),
        (WARN, "", "a part is above 70 deg C", "move less or slower; clean the cabinet's fans"),
        (ERROR, "", "a part is above 80 deg C", "let the arm rest; have it serviced if it comes again"),
    ),
    "servo stream": (
        (OK, "", "no servo target was late", NOTHING),
        (WARN, "too late", "the computer did not send in time", "take load from the computer; ~realtime_priority"),
    ),
    "velocity jog": (
        (OK, "", "nobody jogs, or who is named", NOTHING),
    ),
    "kinematic model": (
        (OK, "", "~model agrees with the controller, or is not compared now", NOTHING),
        (ERROR, "differs", "the driver computes with another arm than this one",
         "set model, or a model file for a calibrated arm (dh_file)"),
    ),
    "audit log": (
        (OK, "written", "it is recorded who does what", NOTHING),
        (WARN, "switched off", "~audit_dir is empty: nobody records who does what", "set audit_dir"),
        (WARN, "cannot be written", "folder or disk fails, lines wait", "make room, or set audit_dir"),
        (WARN, "lost", "lines could not be kept; their number is in the log", "make room on the disk"),
    ),
    "versions": (
        (OK, "", "what runs", NOTHING),
    ),
    "": (
        (STALE, "no fresh state", "it cannot be told without a state", "see status feed and controller link"),
        (ERROR, "this check failed", "a defect of this check, of nothing else", "send the log"),
    ),
}
STATES: Tuple[ShownState, ...] = tuple(ShownState(check, *row) for check, rows in _TABLE.items() for row in rows)


def state_of(check: str, level: int, message: str) -> Optional[ShownState]:
    """Return the entry for what a check shows; None where there is none."""
    return next((state for state in STATES if state.check in (check, "") and state.level == level
                 and state.words in message), None)


def markdown() -> str:
    """Return the table of all states for docs/operation.md."""
    lines = ["| check | level | message | meaning | remedy |", "|---|---|---|---|---|"]
    lines += ["| %s | %s | %s | %s | %s |" % (
        state.check or "any", _NAMES[state.level], state.words.strip(" :") or "any other", state.meaning, state.remedy)
        for state in STATES]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    print(markdown(), end="")
