"""Names for topics and fields where their own are not allowed: of files, members of archives, views in SQL, columns."""
import re
from typing import Callable, Dict, Iterable, Tuple


def plain_name(topic: str) -> str:
    """Return a topic's name for a file: with ``_`` for a slash, and for what is no letter, digit, dot or ``-``."""
    return re.sub(r"[^\w.-]+", "_", topic.strip("/"))


def unique_names(topics: Iterable[str], plain: Callable[[str], str] = plain_name) -> Dict[str, str]:
    """Return a name for each topic, no two of which are equal, capital letters or not.

    Of topics that ``plain`` gives one name the first in the alphabet has it, the others have it with ``_2``, ``_3``.
    """
    names: Dict[str, str] = {}
    taken = set()
    for topic in sorted(topics):
        name, number = plain(topic), 2
        while name.lower() in taken:
            name, number = "%s_%d" % (plain(topic), number), number + 1
        taken.add(name.lower())
        names[topic] = name
    return names


def column_names(fields: Iterable[str], own: Iterable[str] = ("log_time",)) -> Dict[str, str]:
    """Return the name of a column for each field: with a ``_`` more where the table, or an earlier field, has it."""
    names: Dict[str, str] = {}
    taken = set(own)
    for field in fields:
        name = field
        while name in taken:
            name += "_"
        taken.add(name)
        names[field] = name
    return names


def meetings(names: Dict[str, str], plain: Callable[[str], str] = plain_name) -> Tuple[str, ...]:
    """Return a line for each topic whose name of ``unique_names`` is not the plain one."""
    return tuple("%s is named %s: %s is another topic's name" % (topic, name, plain(topic))
                 for topic, name in names.items() if name != plain(topic))
