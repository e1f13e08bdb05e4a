"""Storage files of rosbag2 made by sqlite3 alone, as the storage plugin of ROS 2 lays them out."""
import sqlite3
from pathlib import Path
from typing import Dict, Iterable

from log_samples import Sample

from jaka_bag.messages.connection import Connection
from jaka_bag.messages.ros2_types import Ros2Type

_TABLES = """
CREATE TABLE schema(schema_version INTEGER PRIMARY KEY, ros_distro TEXT NOT NULL);
INSERT INTO schema VALUES (4, 'jazzy');
CREATE TABLE metadata(id INTEGER PRIMARY KEY, metadata_version INTEGER NOT NULL, metadata TEXT NOT NULL);
CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL, serialization_format TEXT NOT NULL,
    offered_qos_profiles TEXT NOT NULL, type_description_hash TEXT NOT NULL);
CREATE TABLE message_definitions(id INTEGER PRIMARY KEY, topic_type TEXT NOT NULL, encoding TEXT NOT NULL,
    encoded_message_definition TEXT NOT NULL, type_description_hash TEXT NOT NULL);
CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL, timestamp INTEGER NOT NULL,
    data BLOB NOT NULL);
CREATE INDEX timestamp_idx ON messages (timestamp ASC);
"""


def write_database(path: Path, samples: Iterable[Sample]) -> Path:
    """Write messages of ROS 1 as CDR in the order given; return the path."""
    database = sqlite3.connect(str(path))
    database.executescript(_TABLES)
    kinds: Dict[Connection, Ros2Type] = {}
    for sample in samples:
        if sample.connection not in kinds:
            kind = kinds[sample.connection] = Ros2Type(sample.connection)
            database.execute("INSERT INTO topics VALUES (?, ?, ?, 'cdr', '', ?)", (
                len(kinds), sample.connection.topic, kind.name, kind.type_hash))
            database.execute("INSERT INTO message_definitions VALUES (?, ?, 'ros2msg', ?, ?)", (
                len(kinds), kind.name, kind.definition, kind.type_hash))
        database.execute("INSERT INTO messages VALUES (NULL, ?, ?, ?)", (
            list(kinds).index(sample.connection) + 1, sample.time, kinds[sample.connection].to_cdr(sample.data)))
    database.commit()
    database.close()
    return path
