"""The reader of rosbag2 folders, sqlite3 and MCAP storage, by the library rosbags; facts without it and numpy.

Functions that read raise ``BagError`` where the folder is damaged, or the storage is not one that rosbags reads.
"""
import importlib
import os
from pathlib import Path
from typing import Any, Dict, Iterator, List, Optional, Tuple

from ..errors import BagError, DefinitionError, MissingDependency
from ..messages.connection import Connection
from ..messages.ros2_types import Ros1Type, ros1_name
from ..paths import PathLike

METADATA = "metadata.yaml"


def is_rosbag2(path: PathLike) -> bool:
    """Return whether a path is a rosbag2 folder."""
    return os.path.isfile(os.path.join(str(path), METADATA))


def describe(folder: PathLike) -> Dict[str, Any]:
    """Return the facts of a folder from its ``metadata.yaml``, in the form of ``jaka_bag info`` for a log."""
    import yaml

    try:
        with open(os.path.join(str(folder), METADATA), encoding="utf-8") as file:
            facts = yaml.safe_load(file)["rosbag2_bagfile_information"]
        duration, start = facts["duration"]["nanoseconds"], facts["starting_time"]["nanoseconds_since_epoch"]
        count = facts["message_count"]
        topics = [{"topic": t["topic_metadata"]["name"], "type": t["topic_metadata"]["type"], "md5sum": "",
                   "messages": t["message_count"], "connections": 1, "latching": False, "callers": []}
                  for t in facts["topics_with_message_count"]]
        codec = facts.get("compression_format") or ""
        size = sum(path.stat().st_size for path in Path(folder).rglob("*") if path.is_file())
        return {
            "path": str(folder), "format": "rosbag2", "version": str(facts["version"]), "profile": "ros2",
            "library": facts["storage_identifier"], "size": size,
            "start_ns": start if count else None, "end_ns": start + duration if count else None,
            "duration": duration / 1e9 if count else None, "messages": count, "chunks": 0,
            "compression": [{"codec": codec, "chunks": 0, "stored": 0, "uncompressed": 0}] if codec else [],
            "types": [{"type": name, "md5sum": ""} for name in sorted({topic["type"] for topic in topics})],
            "topics": sorted(topics, key=lambda topic: str(topic["topic"])), "attachments": [], "metadata": [],
            "notes": []}
    except (OSError, ValueError, KeyError, TypeError, yaml.YAMLError) as error:
        raise BagError("%s is a rosbag2 folder whose %s cannot be read: %s" % (folder, METADATA, error)) from error


def _is_latched(profiles: Any) -> bool:
    """Return whether one of the offered qualities of service keeps messages for late subscribers."""
    if isinstance(profiles, str):  # as YAML, in older versions of rosbags
        return "durability: 1\n" in profiles + "\n" or "durability: transient_local" in profiles
    return any(getattr(profile.durability, "name", "") == "TRANSIENT_LOCAL" for profile in profiles)


class Rosbag2Folder:
    """A rosbag2 folder open for reading, as ROS 1 sees it; a context manager.

    Args:
        folder: The folder.

    Attributes:
        connections: Those whose types ROS 1 can have.
        left_out: Parts that are not read, one line each.
        start_time: Earliest log time, ns; None without messages.
        end_time: Latest log time, ns; None without messages.
        message_count: Messages of ``connections``.

    Raises:
        MissingDependency: rosbags is not installed.
    """

    def __init__(self, folder: PathLike) -> None:
        try:
            rosbag2 = importlib.import_module("rosbags.rosbag2")
        except ImportError:
            raise MissingDependency("rosbag2 folders need the Python package rosbags") from None
        self.folder = str(folder)
        facts = describe(folder)
        self.start_time: Optional[int] = facts["start_ns"]
        self.end_time: Optional[int] = facts["end_ns"]
        self.connections: List[Connection] = []
        self.left_out: List[str] = []
        self.message_count = 0
        self._types: Dict[str, Ros1Type] = {}
        self._numbers: Dict[Any, int] = {}
        self._wanted: List[Any] = []
        try:
            self._reader: Any = rosbag2.Reader(Path(folder))
            self._reader.open()
        except Exception as error:  # ReaderError, OSError, errors of sqlite3: whatever the storage meets
            raise BagError("%s: %s" % (folder, error)) from error
        for source in self._reader.connections:
            self._take(source)

    def _take(self, source: Any) -> None:
        text = getattr(source.msgdef, "data", source.msgdef) or ""
        is_idl = getattr(getattr(source.msgdef, "format", None), "name", "") == "IDL"
        try:
            if source.msgtype not in self._types:
                self._types[source.msgtype] = Ros1Type(source.msgtype, text, is_idl)
        except DefinitionError as error:
            self.left_out.append("%s is left out: %s" % (source.topic, error))
            return
        kind = self._types[source.msgtype]
        self._numbers[source.id] = len(self.connections)
        self._wanted.append(source)
        self.message_count += source.msgcount
        self.connections.append(Connection(source.topic, ros1_name(source.msgtype), kind.md5sum, kind.definition,
                                           latching=_is_latched(source.ext.offered_qos_profiles)))

    def messages(self) -> Iterator[Tuple[int, int, bytes]]:
        """Yield (number of the connection, log time in ns, ROS 1 message) of each message, in the order of time."""
        try:
            for source, log_time, raw in self._reader.messages(self._wanted) if self._wanted else ():
                yield self._numbers[source.id], log_time, self._types[source.msgtype].to_ros1(raw)
        except BagError:
            raise
        except Exception as error:
            raise BagError("%s: %s" % (self.folder, error)) from error

    def __enter__(self) -> "Rosbag2Folder":
        return self

    def __exit__(self, *exception: object) -> None:
        self._reader.close()
