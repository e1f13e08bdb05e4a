"""The writer of rosbag2 folders (MCAP storage) from ROS 1 messages, which become CDR, or from those of ROS 2."""
import os
from pathlib import Path
from typing import Any, Dict, List, Optional

import numpy as np
import yaml

from ..errors import OutputExists, WriteFailed
from ..messages.batch import Array, MessageBatch
from ..messages.cdr import CdrConverter, cdr_batch
from ..messages.connection import Connection
from ..output_file import OutputFolder
from ..paths import PathLike
from .interface import EncodedChunk
from .mcap.writer import McapWriter

_VERSION = 8  # of metadata.yaml; the newest that the readers of both supported rosbags generations know
_UNLIMITED = {"sec": 2147483647, "nsec": 4294967295}
_LATCHED: List[Dict[str, Any]] = [{
    "history": 3, "depth": 0, "reliability": 1, "durability": 1, "deadline": _UNLIMITED, "lifespan": _UNLIMITED,
    "liveliness": 1, "liveliness_lease_duration": _UNLIMITED, "avoid_ros_namespace_conventions": False}]
"""Quality of service of a latched topic as ``metadata.yaml`` numbers it: reliable, transient local."""


class _PlainDumper(yaml.SafeDumper):
    """A YAML dumper that writes a value in full at each place: not every reader of metadata.yaml knows aliases."""

    def ignore_aliases(self, data: Any) -> bool:
        return True


def _yaml(value: Any) -> str:
    text: str = yaml.dump(value, Dumper=_PlainDumper, sort_keys=False)
    return text


class Rosbag2Writer(McapWriter):
    """A rosbag2 folder being written as ``NAME.part``; messages of ROS 1 become CDR, which is kept where it is given.

    Args:
        folder: Final path of the folder.
        compression: Compression of the chunks, as for ``LogWriter``.
        level: The codec's level; None for the fast default.
        overwrite: Replace an existing rosbag2 folder.

    Raises:
        OutputExists: The folder exists and ``overwrite`` is False, or it is no rosbag2 folder.
        BagError: The compression is not MCAP's, or the output cannot be created.
    """

    def __init__(self, folder: PathLike, compression: Optional[str] = None, level: Optional[int] = None,
                 overwrite: bool = False) -> None:
        self.folder = Path(os.path.abspath(str(folder)))
        self._overwrite = overwrite
        self._check_target()
        name = self.folder.name + ".mcap"
        self._output_folder = OutputFolder(self.folder, lambda left: left in (name, name + ".part"))
        self._converters: Dict[int, CdrConverter] = {}
        self._channel_of: Dict[Connection, int] = {}
        self._topics: Dict[int, Dict[str, str]] = {}
        try:
            super().__init__(self._output_folder.working_path / name, compression, level,
                             overwrite=True, profile="ros2")
        except BaseException:
            self._output_folder.abort()
            raise

    def _check_target(self) -> None:
        if not os.path.lexists(str(self.folder)):
            return
        if not self._overwrite:
            raise OutputExists("%s exists (--force overwrites it)" % self.folder)
        if not (self.folder / "metadata.yaml").is_file():
            raise OutputExists("%s exists and is no rosbag2 folder: it is not overwritten" % self.folder)

    def add_channel(self, connection: Connection) -> int:
        """Return the channel id of a connection; those of ROS 1 of one topic, type and quality of service share it."""
        known = self._channel_of.get(connection)
        if known is not None:
            return known
        if connection.encoding != "cdr":
            converter = CdrConverter(connection)
            kind = converter.kind
            qos = _yaml(_LATCHED).strip() if connection.latching else ""
            channel = super().add_channel(Connection(
                connection.topic, kind.name, "", kind.definition, extra=(("offered_qos_profiles", qos),),
                encoding="cdr", schema_encoding="ros2msg"))
            self._converters.setdefault(channel, converter)
            facts = (kind.name, "cdr", qos, kind.type_hash)
        else:
            channel = super().add_channel(connection)
            extra = dict(connection.extra)
            facts = (connection.datatype, connection.encoding, extra.get("offered_qos_profiles", ""),
                     extra.get("topic_type_hash", ""))
        self._channel_of[connection] = channel
        self._topics[channel] = {"name": connection.topic, **dict(zip((
            "type", "serialization_format", "offered_qos_profiles", "type_description_hash"), facts))}
        return channel

    def encode(self, batch: MessageBatch, channel_ids: Array) -> Optional[EncodedChunk]:
        """Convert messages of ROS 1 to CDR and make a chunk of a batch; see ``LogWriter.encode``."""
        numbered = cdr_batch(batch.with_connections(channel_ids), self._converters)
        return super().encode(numbered, np.arange(int(channel_ids.max(initial=0)) + 1))

    def _metadata(self) -> Dict[str, Any]:
        name = self.folder.name + ".mcap"
        start = self._start_time or 0
        span = {"duration": {"nanoseconds": max(0, self._end_time - start)},
                "starting_time": {"nanoseconds_since_epoch": start}, "message_count": self.message_count}
        topics = [{"topic_metadata": facts, "message_count": self._channel_counts.get(channel, 0)}
                  for channel, facts in self._topics.items()]
        return {"version": _VERSION, "storage_identifier": "mcap", **span, "topics_with_message_count": topics,
                "compression_format": "", "compression_mode": "", "relative_file_paths": [name],
                "files": [{"path": name, **span}], "custom_data": None, "ros_distro": "unknown"}

    def close(self) -> None:
        """Finish the MCAP, write ``metadata.yaml`` and give the folder its name.

        Raises:
            WriteFailed: The system refused; the working folder stays.
            OutputExists: The final name was taken meanwhile; the working folder stays.
        """
        if self._closed:
            return
        self.flush()
        metadata = self._metadata()
        self.add_metadata("rosbag2", {"serialized_metadata": _yaml(metadata)})
        super().close()
        try:
            (self._output_folder.working_path / "metadata.yaml").write_text(
                _yaml({"rosbag2_bagfile_information": metadata}), encoding="utf-8")
            self._check_target()
            self._output_folder.commit()
        except OSError as error:
            raise WriteFailed(str(self.folder), error) from error

    def abort(self) -> None:
        """Give up: remove the working folder."""
        super().abort()
        self._output_folder.abort()
