"""The service types of the installed jaka_msgs, with a stand-in for each that it lacks.

A ``jaka_msgs`` from elsewhere (``JAKA_MSGS_EXTERNAL=1``) may lack any of them, as the maker's lacks ``ClearErr``.
"""
from typing import TYPE_CHECKING, Any, NamedTuple

from jaka_msgs import srv as _installed

__all__ = ["FOLDER", "AbsentType", "services"]

FOLDER: str = _installed.__path__[0]
"""The folder of the installed types."""


class AbsentType(NamedTuple):
    """The stand-in of a type that the installed jaka_msgs lacks."""

    name: str


class _Services:
    """The types by their names."""

    def __getattr__(self, name: str) -> Any:
        return getattr(_installed, name, AbsentType(name))


if TYPE_CHECKING:
    from jaka_msgs import srv as services
else:
    services = _Services()
