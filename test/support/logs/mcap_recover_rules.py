"""A recovery by the rules of ``mcap recover``, which is not Python, made of the library mcap.

Records are copied one by one in the order of the file. A chunk whose CRC is wrong, or that cannot be unpacked or read
to its end, is left out as a whole; the first error elsewhere ends the file.

    build/venv/bin/python3 test/support/logs/mcap_recover_rules.py IN OUT
"""
import sys
from pathlib import Path
from typing import Dict, Iterator

from mcap.records import Attachment, Channel, Chunk, McapRecord, Message, Metadata, Schema
from mcap.stream_reader import StreamReader, breakup_chunk
from mcap.writer import CompressionType, Writer


def records(path: Path) -> Iterator[McapRecord]:
    """Yield the records that are kept."""
    with path.open("rb") as stream:
        try:
            for record in StreamReader(stream, emit_chunks=True, record_size_limit=path.stat().st_size).records:
                if isinstance(record, Chunk):
                    try:
                        inside = breakup_chunk(record, validate_crc=True)
                    except Exception:  # each codec has errors of its own
                        continue
                    yield from inside
                else:
                    yield record
        except Exception:  # whatever the library meets: the records before it are kept
            return


def main() -> int:
    """Recover; return 1 where no message is kept."""
    source, target = map(Path, sys.argv[1:])
    schemas: Dict[int, int] = {0: 0}
    channels: Dict[int, int] = {}
    kept = 0
    with target.open("wb") as stream:
        writer = Writer(stream, compression=CompressionType.ZSTD)
        writer.start("ros1", "rules of mcap recover")
        for record in records(source):
            if isinstance(record, Schema) and record.id not in schemas:
                schemas[record.id] = writer.register_schema(record.name, record.encoding, record.data)
            elif isinstance(record, Channel) and record.id not in channels and record.schema_id in schemas:
                channels[record.id] = writer.register_channel(
                    record.topic, record.message_encoding, schemas[record.schema_id], record.metadata)
            elif isinstance(record, Message) and record.channel_id in channels:
                writer.add_message(channels[record.channel_id], record.log_time, record.data, record.publish_time,
                                   record.sequence)
                kept += 1
            elif isinstance(record, Attachment):
                writer.add_attachment(record.create_time, record.log_time, record.name, record.media_type, record.data)
            elif isinstance(record, Metadata):
                writer.add_metadata(record.name, record.metadata)
        writer.finish()
    return int(not kept)


if __name__ == "__main__":
    sys.exit(main())
