"""The result of a check, and the check itself."""
import enum
from typing import TYPE_CHECKING, Callable, NamedTuple

if TYPE_CHECKING:
    from jaka_ros_driver.doctor.subject import ExaminedSystem


class Level(enum.Enum):
    """The weight of a finding."""

    OK = "ok"
    SKIPPED = "skipped"
    WARNING = "warning"
    FAULT = "fault"


class Observation(NamedTuple):
    """The result of a check.

    Attributes:
        level: A fault is what keeps a driver from starting or from working as it should.
        found: The fact, in a few words.
        meaning: Its consequence for the driver.
        remedy: What to do.
    """

    level: Level
    found: str
    meaning: str
    remedy: str


class Examination(NamedTuple):
    """One row of the table of checks; ``look`` never raises for what it looks at, and needs no other check."""

    name: str
    look: "Callable[[ExaminedSystem], Observation]"


def good(found: str, meaning: str) -> Observation:
    """Return the finding that all is well."""
    return Observation(Level.OK, found, meaning, "nothing")


def skipped(found: str, remedy: str = "nothing") -> Observation:
    """Return the finding that the check could not be made."""
    return Observation(Level.SKIPPED, found, "not checked", remedy)


def warning(found: str, meaning: str, remedy: str) -> Observation:
    """Return the finding of something that a driver can live with."""
    return Observation(Level.WARNING, found, meaning, remedy)


def fault(found: str, meaning: str, remedy: str) -> Observation:
    """Return the finding of something that must be repaired."""
    return Observation(Level.FAULT, found, meaning, remedy)
