"""YAML of files and strangers, whose nesting is bounded before a parser recurses into it; ``json_text`` tells why."""
from typing import Any, Dict

import yaml

DEEPEST = 60
"""Most levels of a text, those that aliases stand for among them; a scenario and rosbag2's metadata have ten."""


class BoundedLoader(yaml.SafeLoader):
    """The safe loader in Python, bounded: brackets overflow the stack of the one in C.

    Raises:
        yaml.YAMLError: The text is no YAML, has more than ``DEEPEST`` levels, or a node that holds itself.
        ValueError: It holds a date or a number that is none.
    """

    def __init__(self, stream: Any) -> None:
        super().__init__(stream)
        self._heights: Dict[Any, int] = {}
        self._inside = [0]  # of each node that is open, the height of what it holds so far

    def compose_node(self, parent: Any, index: Any) -> Any:
        """Return a node that has no more than the levels that are left."""
        event = self.peek_event()  # type: ignore[no-untyped-call]
        self._bound(1, event)
        self._inside.append(0)
        node = super().compose_node(parent, index)
        inside = self._inside.pop()
        if isinstance(event, yaml.AliasEvent) and node not in self._heights:
            raise yaml.composer.ComposerError(None, None, "a node holds itself", event.start_mark)
        height = self._heights.setdefault(node, 1 + inside)
        self._bound(height, event)
        self._inside[-1] = max(self._inside[-1], height)
        return node

    def _bound(self, height: int, event: yaml.Event) -> None:
        if len(self._inside) - 1 + height > DEEPEST:
            raise yaml.composer.ComposerError(None, None, "deeper than %d levels" % DEEPEST, event.start_mark)


def load_yaml(text: Any) -> Any:
    """Return the value of a text, or of a file that is open; errors are those of ``BoundedLoader``."""
    return yaml.load(text, BoundedLoader)
