"""The launch files of a package as they stand, with the values of their arguments as far as they are known.

An ``$(arg NAME)`` is replaced by the value or default that the same file gives it.
"""
import re
from typing import Dict, FrozenSet, Iterator, List, NamedTuple

from jaka_migration.bounded_files import Element, Unreadable, read_xml
from jaka_migration.package import Package
from jaka_migration.report import ConfigReport

_LONGEST_VALUE = 1000
_ARG = re.compile(r"\$\(arg\s+([^\s()]+)\s*\)")
_DEMO = re.compile(r"/demo\w*\.launch$")


class LaunchFile(NamedTuple):
    """A launch file.

    Attributes:
        file: Its name, relative to the package.
        root: Its root element.
        arguments: Values that it gives to its own arguments, or their defaults.
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
        words = [self.resolved(element.get(key)).lower() if key in element.attributes else "" for key in (
            "if", "unless")]
        return words[0] in ("false", "0") or words[1] in ("true", "1")


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
        arguments: Dict[str, str] = {}
        own = root.all("arg") + [arg for group in root.all("group") for arg in group.all("arg")]
        for arg in own:
            if "value" in arg.attributes or "default" in arg.attributes:
                value = arg.attributes.get("value", arg.get("default"))
                arguments.setdefault(arg.get("name"), value[:_LONGEST_VALUE])
        found.append(LaunchFile(file, root, arguments, frozenset(arg.get("name") for arg in own)))
    return found
