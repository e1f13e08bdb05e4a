"""The form of a mutant, and the change of its file."""
from pathlib import Path
from typing import NamedTuple, Tuple


class Mutant(NamedTuple):
    """One defect.

    Attributes:
        name: What goes wrong.
        file: Path below ``jaka_ros_driver``.
        old: The text to be replaced.
        new: The text in its place.
        tests: Arguments of pytest.
    """

    name: str
    file: str
    old: str
    new: str
    tests: Tuple[str, ...]


def path_of(root: Path, mutant: Mutant) -> Path:
    """Return the file that a mutant changes."""
    return root / "jaka_ros_driver" / mutant.file


def mutated(mutant: Mutant, text: str) -> str:
    """Return the text of its file with the defect; raise ValueError where it fits in no place, or in several."""
    if text.count(mutant.old) != 1:
        raise ValueError("%s: its text occurs %d times in %s" % (mutant.name, text.count(mutant.old), mutant.file))
    return text.replace(mutant.old, mutant.new)
