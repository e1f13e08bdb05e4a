"""The declarations of a rosbag2 folder's ``metadata.yaml``, and how they differ from its files; without numpy."""
import contextlib
import os
from typing import Dict, List, NamedTuple, Optional, Sequence, Tuple

from ..errors import BagError
from ..paths import PathLike
from .index import METADATA, PACKED

_ROUNDING = 1000
"""Difference of times, ns, that is none: recorders round them."""


def _seconds(time: int) -> str:
    return "%d.%09d" % divmod(time, 10**9)


class Declarations(NamedTuple):
    """The declarations of ``metadata.yaml``.

    Attributes:
        names: Names of the files.
        messages: Messages in all of them.
        topics: Messages by topic.
        span: First and last log time, ns; None where they are not told.
    """

    names: List[str]
    messages: int
    topics: Dict[str, int]
    span: Optional[Tuple[int, int]]

    def contradictions(self, topics: Dict[str, int], total: Optional[int],
                       span: Optional[Tuple[int, int]] = None) -> List[str]:
        """Return where the files disagree, one line each.

        Args:
            topics: Messages in the files by topic.
            total: Messages in the files; None where not all were counted.
            span: Their first and last log time, ns; None where there are none, or they are not compared.
        """
        result = []
        if total is not None and total != self.messages:
            result.append("%s tells of %d messages, the files hold %d" % (METADATA, self.messages, total))
        result += ["%s: %s tells of %d messages, the files hold %d" % (
            topic, METADATA, self.topics.get(topic, 0), count)
            for topic, count in sorted(topics.items()) if count != self.topics.get(topic, 0)]
        if span and self.span and max(abs(a - b) for a, b in zip(span, self.span)) > _ROUNDING:
            result.append("%s tells of times from %s to %s s, the files hold %s to %s s" % (
                METADATA, *map(_seconds, self.span), *map(_seconds, span)))
        return result


def declarations(folder: PathLike) -> Declarations:
    """Read the declarations of ``metadata.yaml``.

    Raises:
        BagError: It is not there, or cannot be read.
    """
    import yaml

    from jaka_bag.yaml_text import load_yaml

    path = os.path.join(str(folder), METADATA)
    try:
        with open(path, encoding="utf-8") as file:
            facts = load_yaml(file)["rosbag2_bagfile_information"]
        names = [os.path.basename(str(name)) for name in facts["relative_file_paths"]]
        topics: Dict[str, int] = {}
        for topic in facts["topics_with_message_count"]:
            name = str(topic["topic_metadata"]["name"])
            topics[name] = topics.get(name, 0) + int(topic["message_count"])
        span = None
        with contextlib.suppress(KeyError, TypeError, ValueError, OverflowError):
            start = int(facts["starting_time"]["nanoseconds_since_epoch"])
            span = start, start + int(facts["duration"]["nanoseconds"])
        return Declarations(names, int(facts["message_count"]), topics, span)
    except FileNotFoundError:
        raise BagError("there is no %s" % METADATA) from None
    except (OSError, ValueError, KeyError, TypeError, OverflowError, yaml.YAMLError) as error:
        raise BagError("%s cannot be read (%s)" % (METADATA, " ".join(str(error).split())[:160])) from error


def unnamed(names: Sequence[str], there: Sequence[str]) -> List[str]:
    """Return a line for each file of messages that is in a folder, and not among the names of its declarations.

    rosbag2 leaves what it unpacks beside the compressed file, which alone is named.
    """
    return ["%s is not named by %s" % (name, METADATA) for name in there
            if name not in names and name + PACKED not in there]
