"""The launch files of a package as they stand, with the values of their arguments as far as they are known.

An ``$(arg NAME)`` is replaced by the value or default that the same file gives it.
"""
import re
from typing import Dict, FrozenSet, Iterator, List, NamedTuple, Optional

from jaka_migration.bounded_files import Element, Unreadable, read_xml
from jaka_migration.package import Package
from jaka_migration.report import ConfigReport

_LONGEST_VALUE = 1000
"""Most characters of an argument, whose names in it are replaced again and again."""
_ARG = re.compile(r"\$\(arg\s+([^\s()]+)\s*\)")
_DEMO = re.compile(r"/demo\w*\.launch$")


class LaunchFile(NamedTuple):
    """A launch file.

    Attributes:
        file: Its name, relative to the package.
        root: Its root element.
        arguments: Values that it gives to its own arguments, or their defaults; ``$(arg NAME)`` itself where it
            depends on what is not known which of them is taken.
        declared: All arguments that it has, with a value or without.
    """

    file: str
    root: Element
    arguments: Dict[str, str]
    declared: FrozenSet[str]

    @property
    def is_for_gazebo(self) -> bool:
        """True where its name says that it starts the simulation of Gazebo."""
        return "gazebo" in self.file

    @property
    def is_demo(self) -> bool:
        """True for a demo of the Setup Assistant's, which starts MoveIt without an arm, or with Gazebo's."""
        return _DEMO.search(self.file) is not None

    def resolved(self, text: str) -> str:
        """Return a text with the arguments that are known put in."""
        for _ in range(5):  # a default may name another argument
            text = _ARG.sub(lambda found: self.arguments.get(found.group(1), found.group(0)), text[:_LONGEST_VALUE])
        return text.strip()

    def started(self) -> Iterator[Element]:
        """Yield the elements, in the order of the file, that are not left out by an ``if`` or ``unless``."""
        return self._started(self.root)

    def _started(self, element: Element) -> Iterator[Element]:
        yield element
        for child in element.children:
            if not self.is_off(child):
                yield from self._started(child)

    def is_off(self, element: Element) -> bool:
        """Return whether an element is left out by its own ``if`` or ``unless``, as far as that is known."""
        return self.condition(element) is False

    def condition(self, element: Element) -> Optional[bool]:
        """Return whether an element is taken by its own ``if`` and ``unless``; None where that is not known."""
        is_known = True
        for key, is_meant in (("if", True), ("unless", False)):
            if key in element.attributes:
                word = self.resolved(element.get(key)).lower()
                if word in ("true", "1", "false", "0") and (word in ("true", "1")) is not is_meant:
                    return False
                is_known &= word in ("true", "1", "false", "0")
        return True if is_known else None

    def take(self, arg: Element, group: Optional[Element] = None) -> None:
        """Put in the value of an argument, which is the file's own or a group's, where none has it yet."""
        conditions = [self.condition(arg), True if group is None else self.condition(group)]
        if "value" not in arg.attributes and "default" not in arg.attributes or False in conditions:
            return
        name = arg.get("name")
        value = arg.attributes.get("value", arg.get("default")) if None not in conditions else "$(arg %s)" % name
        self.arguments.setdefault(name, value[:_LONGEST_VALUE])


def read_launch_files(package: Package, names: List[str], report: ConfigReport) -> List[LaunchFile]:
    """Return the launch files of these names; add those that cannot be read to the report."""
    found = []
    for file in names:
        try:
            root = read_xml(package.path(file))
            if root.tag != "launch":
                raise Unreadable("is no launch file: its root element is %s" % root.tag, root.line)
        except Unreadable as error:
            report.broken(str(error), file, error.line)
            continue
        groups = [(arg, group) for group in root.all("group") for arg in group.all("arg")]
        launch = LaunchFile(file, root, {}, frozenset(
            arg.get("name") for arg in root.all("arg") + [arg for arg, _ in groups]))
        for arg in root.all("arg"):
            launch.take(arg)
        for arg, group in groups:
            launch.take(arg, group)
        found.append(launch)
    return found
