"""YAML as people write it into files: a key that is given twice is an error, and values are shown short.

Of two equal keys a plain loader keeps the last: a second list of zones would take away the first in silence. And a
plain loader recurses until Python stops it. Python 3.8 may abort the process there: a finaliser that runs at the edge
of the stack uses up the error, the loader goes on, and 50 calls further the interpreter gives up
(https://bugs.python.org/issue42500, mended in 3.9.2). So nesting is bounded long before.
"""
import reprlib
from typing import Any, Dict, Optional, Tuple

from jaka_ros_driver.errors import InvalidCommand

_MERGED = ("tag:yaml.org,2002:merge", "tag:yaml.org,2002:value")
"""Kinds of keys, ``<<`` and ``=``, of which no value is made."""
DEEPEST = 60
"""Most levels of a text; a workspace, a model and a dialect have fewer than ten."""


def load_yaml(text: str) -> Any:
    """Return what a text of YAML holds.

    Raises:
        InvalidCommand: It is no YAML, has more than ``DEEPEST`` levels, or gives a key twice; the message fits behind
            the name of the file.
    """
    import yaml  # imported here, because most users of this module's callers never read a file

    class UniqueKeys(yaml.SafeLoader):  # not the loader in C: deep brackets overflow its stack
        """The loader, which looks at each mapping before keys are merged into it: those may be given again."""

        def __init__(self, stream: str) -> None:
            super().__init__(stream)
            self._seen_nodes = set()  # type: ignore[var-annotated]
            self._depth = 0

        def compose_node(self, parent: Optional[yaml.Node], index: Any) -> Optional[yaml.Node]:
            if self._depth == DEEPEST:
                raise InvalidCommand("is deeper than %d levels in line %d" % (
                    DEEPEST, self.peek_event().start_mark.line + 1))  # type: ignore[no-untyped-call]
            self._depth += 1
            node = super().compose_node(parent, index)
            self._depth -= 1  # an error ends the loader
            return node

        def flatten_mapping(self, node: yaml.MappingNode) -> None:
            """Merge into a mapping, as ``<<`` asks; the second time a mapping is asked for, it has merged keys.

            PyYAML 6.0.4 lets a merged key win over the mapping's own, or not, by its letters: keys are merged here.
            """
            if id(node) in self._seen_nodes:
                return
            self._seen_nodes.add(id(node))
            seen = set()
            for key_node, _ in node.value:
                if not isinstance(key_node, yaml.ScalarNode):
                    continue  # what cannot be a key is told of by the loader itself
                is_plain = key_node.tag not in _MERGED
                key = self.construct_object(key_node, deep=True) if is_plain else key_node.value
                if key in seen:
                    raise InvalidCommand("gives the key %s twice, again in line %d" % (
                        short(key), key_node.start_mark.line + 1))
                seen.add(key)
            pairs, node.value = node.value, []
            merged: Dict[int, Tuple[Any, Any]] = {}  # by the key's node: each is kept once for many aliases
            for key_node, value_node in pairs:
                if key_node.tag == _MERGED[0]:
                    parts = value_node.value if isinstance(value_node, yaml.SequenceNode) else [value_node]
                    for part in reversed(parts):  # of a list the first wins, and of equal keys the last is kept
                        if not isinstance(part, yaml.MappingNode):
                            raise yaml.constructor.ConstructorError(
                                None, None, "expected a mapping for merging", part.start_mark)
                        self.flatten_mapping(part)
                        for pair in part.value:
                            merged.pop(id(pair[0]), None)
                            merged[id(pair[0])] = pair
                else:
                    if key_node.tag == _MERGED[1]:
                        key_node.tag = "tag:yaml.org,2002:str"
                    node.value.append((key_node, value_node))
            node.value[:0] = merged.values()

    try:
        return yaml.load(text, Loader=UniqueKeys)
    except InvalidCommand:
        raise
    except (yaml.YAMLError, ValueError, TypeError) as error:  # a date or a number that is none
        raise InvalidCommand("is no YAML: " + " ".join(str(error).split())) from error


def short(value: Any) -> str:
    """Return a value as error texts show it: short, whatever a file's aliases make of it."""
    try:
        return reprlib.repr(value)
    except ValueError:  # Python prints no integer of more than 4,300 digits
        return "a number of thousands of digits"
