"""The service types of the installed jaka_msgs, a stand-in for each that it lacks, and the warning about that.

A ``jaka_msgs`` from elsewhere (``JAKA_MSGS_EXTERNAL=1``) may lack any of them, as the maker's lacks ``ClearErr``.
"""
import logging
from typing import TYPE_CHECKING, Any, NamedTuple

from jaka_msgs import srv as _installed

__all__ = ["AbsentType", "services", "warn_absent"]

_LOG = logging.getLogger(__name__)


def warn_absent(what: str, change: str, where: Any = _installed) -> None:
    """Log that the installed jaka_msgs lacks a type, and what that changes.

    where: The module that lacks it.
    """
    _LOG.warning("jaka_msgs in %s has no %s: %s", where.__path__[0], what, change)


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
