"""What a mutant is, and how it changes its file."""
from pathlib import Path
from typing import NamedTuple, Tuple


class Mutant(NamedTuple):
    """One defect.

    Attributes:
        name: What goes wrong.
        file: Below ``jaka_ros_driver``.
        old: The text to be replaced.
        new: What stands there instead.
        tests: Arguments of pytest.
    """

    name: str
    file: str
    old: str
    new: str
    tests: Tuple[str, ...]


def path_of(root: Path, mutant: Mutant) -> Path:
    """The file that it changes."""
    return root / "jaka_ros_driver" / mutant.file


def mutated(mutant: Mutant, text: str) -> str:
    """The text of its file with the defect; raises ValueError where it fits in no place, or in several."""
    if text.count(mutant.old) != 1:
        raise ValueError("%s: its text occurs %d times in %s" % (mutant.name, text.count(mutant.old), mutant.file))
    return text.replace(mutant.old, mutant.new)
