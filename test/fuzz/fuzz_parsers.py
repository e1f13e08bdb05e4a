"""Coverage-guided fuzzing of every parser that reads bytes from the network; needs the package atheris (PyPI).

    build/venv/bin/python3 test/fuzz/fuzz_parsers.py TARGET -max_total_time=120

TARGET is objects, frames or requests. What must hold of any bytes: no exception but the documented ones, the same
outcome however the bytes are cut, bounded memory, and no number that is not finite in a state.
"""
import math
import sys
from pathlib import Path

import atheris

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT)]

with atheris.instrument_imports():
    from jaka_ros_driver.errors import FramingError, StatusFrameError
    from jaka_ros_driver.protocol.framing import FrameStream, ObjectStream
    from jaka_ros_driver.protocol.status import encode_frame, parse_status
    from jaka_ros_driver.simulation.server.request_parser import MAX_REQUEST_BYTES, RequestParser

FRAME = (ROOT / "test" / "data" / "frames" / "zu5s_1.5.14.json").read_bytes()
LIMIT = 4096


def shape(items):
    return ["damage" if isinstance(item, FramingError) else item for item in items]


def in_pieces(feed, data, cut):
    items = []
    for start in range(0, len(data), cut):
        items += feed(data[start:start + cut])
    return items


def split(data):
    """Return a cut width, and the bytes to be cut."""
    return (data[0] % 16 + 1, data[1:]) if data else (1, b"")


def objects(data):
    cut, data = split(data)
    stream = ObjectStream(LIMIT)
    assert shape(in_pieces(stream.feed, data, cut)) == shape(ObjectStream(LIMIT).feed(data)) or len(data) > LIMIT
    assert stream.pending <= LIMIT


def frames(data):
    cut, data = split(data)
    data = data + FRAME + FRAME
    whole = FrameStream().feed(data)
    assert shape(in_pieces(FrameStream().feed, data, 97 * cut)) == shape(whole)
    for item in whole:
        if isinstance(item, FramingError):
            continue
        try:
            state = parse_status(item, 0.0)
        except StatusFrameError:
            continue
        assert all(map(math.isfinite, state.joint_position + (state.tcp_position or ()) + (state.tcp_rpy or ())))
        assert encode_frame(item)


def requests(data):
    cut, data = split(data)
    whole, parser = RequestParser(), RequestParser()
    assert shape(whole.feed(data, 0.0)) == shape(in_pieces(lambda piece: parser.feed(piece, 0.0), data, cut))
    assert whole.pending == parser.pending <= MAX_REQUEST_BYTES
    whole.expire(1e9)
    assert whole.pending == 0


TARGETS = {"objects": objects, "frames": frames, "requests": requests}

if __name__ == "__main__":
    target = TARGETS[sys.argv.pop(1)]
    atheris.Setup(sys.argv, target)
    atheris.Fuzz()
