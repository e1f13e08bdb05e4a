"""The reader of rosbag2 folders, sqlite3 and MCAP storage, by the library rosbags; facts without it and numpy.

Functions that read raise ``BagError`` where the folder is damaged, or the storage is not one that rosbags reads.
"""
import contextlib
import importlib
import os
import tempfile
import threading
from pathlib import Path
from typing import Any, Collection, Dict, Iterator, List, Optional, Tuple

from ..errors import BagError, DefinitionError, MissingDependency, TopicRefused
from ..messages.connection import Connection
from ..messages.encodings import is_transient_local
from ..messages.ros2_types import Ros1Type, ros1_name
from ..paths import PathLike
from .compression import unpack_file
from .index import METADATA, PACKED, leftovers, open_for_reading, storage_files
from .rosbag2_declarations import declarations, unnamed
from .sqlite_records import check_tables, open_database

_ONE_AT_A_TIME = threading.Lock()
"""Held by the thread that reads: rosbags 0.10 unpacks every MCAP with one decompressor, which two at once garble."""


def describe(folder: PathLike) -> Dict[str, Any]:
    """Return the facts of a folder from its ``metadata.yaml``, in the form of ``jaka_bag info`` for a log."""
    import yaml

    from jaka_bag.yaml_text import load_yaml

    try:
        with open(os.path.join(str(folder), METADATA), encoding="utf-8") as file:
            facts = load_yaml(file)["rosbag2_bagfile_information"]
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
            "notes": unnamed(declarations(folder).names, storage_files(folder))}
    except (OSError, ValueError, KeyError, TypeError, yaml.YAMLError) as error:
        raise BagError("%s is a rosbag2 folder whose %s cannot be read: %s" % (folder, METADATA, error)) from error


def _is_latched(profiles: Any) -> bool:
    """Return whether one of the offered qualities of service keeps messages for late subscribers."""
    if isinstance(profiles, str):  # as YAML, in older versions of rosbags
        return is_transient_local(profiles)
    return any(getattr(profile.durability, "name", "") == "TRANSIENT_LOCAL" for profile in profiles)


def _unpacked(folder: PathLike) -> "Optional[tempfile.TemporaryDirectory[str]]":
    """Return a temporary copy of a folder whose files are compressed as a whole, unpacked; None where they are not."""
    import yaml

    from jaka_bag.yaml_text import load_yaml

    with open(os.path.join(str(folder), METADATA), encoding="utf-8") as file:
        document = load_yaml(file)
    facts = document["rosbag2_bagfile_information"]
    if str(facts.get("compression_mode", "")).lower() != "file" or facts.get("compression_format") != "zstd":
        return None
    copy = tempfile.TemporaryDirectory(prefix="jaka_bag")
    try:
        names = []
        for name in map(os.path.basename, facts["relative_file_paths"]):
            names.append(name[:-len(PACKED)] if name.endswith(PACKED) else name)
            path = os.path.join(str(folder), name)
            with open_for_reading(path) as packed, open(os.path.join(copy.name, names[-1]), "wb") as unpacked:
                reason = unpack_file(packed.fileno(), os.path.getsize(path), unpacked)[1]
            if reason:
                raise BagError("%s cannot be unpacked: %s" % (name, reason))
        facts.update(relative_file_paths=names, compression_mode="", compression_format="")
        with open(os.path.join(copy.name, METADATA), "w", encoding="utf-8") as file:
            yaml.safe_dump(document, file)
    except BaseException:
        copy.cleanup()
        raise
    return copy


class Rosbag2Folder:
    """A rosbag2 folder as ROS 1 sees it; it is open only while messages are read.

    Files that are compressed as a whole are unpacked once, into a temporary folder that goes with ``close``.

    Args:
        folder: The folder.

    Attributes:
        connections: Those whose types ROS 1 can have.
        left_out: Parts that are not read, one line each.

    Raises:
        BagError: It cannot be read, or has a file of messages that its ``metadata.yaml`` does not name.
        DefinitionError: There are messages, and ROS 1 can have none of them.
        MissingDependency: rosbags is not installed.
    """

    def __init__(self, folder: PathLike) -> None:
        try:
            self._library = importlib.import_module("rosbags.rosbag2")
        except ImportError:
            raise MissingDependency("rosbag2 folders need the Python package rosbags") from None
        self.folder = str(folder)
        strangers = describe(folder)["notes"]  # which also says in one line what is wrong with it
        if strangers:
            raise BagError("%s: %s (jaka_bag recover takes it up)" % (folder, strangers[0]))
        self.connections: List[Connection] = []
        self.left_out: List[str] = []
        self._types: Dict[str, Ros1Type] = {}
        self._numbers: Dict[Any, int] = {}
        self._wanted: Optional[Collection[int]] = None
        self._copy: Optional[tempfile.TemporaryDirectory[str]] = None
        try:
            if any(leftovers(os.path.join(self.folder, name)) for name in storage_files(folder)):
                raise BagError("the writer of a database was cut off and left changes beside it")  # rosbags reads none
            self._copy = _unpacked(folder)
            self._read_folder = self._copy.name if self._copy else self.folder
            for name in storage_files(self._read_folder):
                if name.endswith(".db3"):
                    with contextlib.closing(open_database(os.path.join(self._read_folder, name))) as database:
                        check_tables(database)
            with self._open() as reader:
                sources = list(reader.connections)
        except Exception as error:  # ReaderError, OSError, errors of sqlite3: whatever the storage meets
            self.close()
            raise BagError("%s: %s (jaka_bag recover keeps what can be read)" % (folder, error)) from error
        for source in sources:
            self._take(source)
        if self.left_out and not self.connections:
            self.close()
            raise DefinitionError("%s: %s" % (folder, "; ".join(self.left_out)))

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
        self.connections.append(Connection(source.topic, ros1_name(source.msgtype), kind.md5sum, kind.definition,
                                           latching=_is_latched(source.ext.offered_qos_profiles)))

    def decode_only(self, numbers: Collection[int]) -> None:
        """Take the numbers of the connections that are wanted; the messages of others are left out."""
        self._wanted = numbers

    def messages(self, start: Optional[int] = None, stop: Optional[int] = None) -> Iterator[Tuple[int, int, bytes]]:
        """Yield (number of the connection, log time in ns, ROS 1 message) of each message, in the order of time.

        Several threads may call it at once.

        Args:
            start: Earliest log time, ns; None for no limit.
            stop: The first log time, ns, that is not wanted; None for no limit.

        Raises:
            TopicRefused: A message does not fit its definition.
        """
        for source, log_time, raw in self._raw_messages(start, stop):
            try:
                yield self._numbers[source.id], log_time, self._types[source.msgtype].to_ros1(raw)
            except DefinitionError as error:
                raise TopicRefused("%s: %s" % (self.folder, error), source.topic) from error

    def sizes(self) -> Iterator[Tuple[int, int, int]]:
        """Yield (number of the connection, log time in ns, bytes) of each message."""
        for source, log_time, raw in self._raw_messages(None, None):
            yield self._numbers[source.id], log_time, len(raw)

    def close(self) -> None:
        """Remove what was unpacked."""
        if self._copy:
            self._copy.cleanup()

    def _is_wanted(self, source_id: Any) -> bool:
        number = self._numbers.get(source_id)
        return number is not None and (self._wanted is None or number in self._wanted)

    @contextlib.contextmanager
    def _open(self) -> Iterator[Any]:
        """Open a reader for the thread that calls: databases are of the thread that opens them."""
        with contextlib.ExitStack() as stack:
            with _ONE_AT_A_TIME:  # an MCAP without a summary is unpacked here
                reader = stack.enter_context(self._library.Reader(Path(self._read_folder)))
            yield reader

    def _raw_messages(self, start: Optional[int], stop: Optional[int]) -> Iterator[Tuple[Any, int, bytes]]:
        try:
            with self._open() as reader:
                wanted = [source for source in reader.connections if self._is_wanted(source.id)]
                # rosbags 0.9, that of Python 3.8, leaves out chunks of MCAP that end where the wanted time begins
                before = start - 1 if start else None
                messages = reader.messages(wanted, start=before, stop=stop) if wanted else iter(())
                while True:
                    with _ONE_AT_A_TIME:
                        found = next(messages, None)
                    if found is None:
                        return
                    if start is None or found[1] >= start:
                        yield found
        except Exception as error:
            raise BagError("%s: %s (jaka_bag recover keeps what can be read)" % (self.folder, error)) from error
