"""Messages that are large and compress to little: what one command writes, every command reads."""
import json
import struct
import subprocess
import sys

import pytest
from hostile_logs import MOST_BYTES, RUN_ALL
from log_samples import START_NS, STATES, Sample, connection, read, states, write

from jaka_bag.cli.main import main
from jaka_bag.containers.bag.writer import BagWriter
from jaka_bag.containers.compression import is_readable
from jaka_bag.containers.mcap.writer import McapWriter
from jaka_bag.containers.registry import open_log, read_codecs
from jaka_bag.live.log_source import LogSource

MAP = connection("/map", "nav_msgs/Map", "uint32 width\nuint8[] data\n")
MAP_BYTES = 49_000_000
MOST_TABLE_BYTES = 1200 << 20
"""Memory for a table of maps, or one as text, byte: a cell and its copy in the form that is written."""
LOW_LIMIT = "import jaka_bag.containers.compression as c\nc._BARREN_FLOOR, c._BARREN_RATIO = 1 << 20, 0\n"


def map_of(size, time=START_NS):
    return Sample(MAP, time, struct.pack("<II", 7000, size) + bytes(size))


def run_all(calls, before=""):
    """Run commands in one program; check that each succeeds, and return the most memory, byte, until its end."""
    done = subprocess.run([sys.executable, "-c", before + RUN_ALL, json.dumps([list(map(str, c)) for c in calls])],
                          capture_output=True, timeout=300)
    assert done.returncode == 0, done.stderr[-2000:]
    results = json.loads(done.stdout.splitlines()[-1])
    assert [code for code, _, _ in results] == [0] * len(calls), done.stderr
    return [most for _, _, most in results]


@pytest.mark.parametrize("suffix, codec", [(".mcap", "zstd"), (".bag", "bz2")])
def test_a_map_that_compresses_to_little_is_read_by_every_command(tmp_path, suffix, codec):
    path = write(tmp_path / ("map" + suffix), [map_of(MAP_BYTES), *(
        states(START_NS + i * 10**9, i, 1, 0, 0) for i in range(2))], codec)
    assert path.stat().st_size < MAP_BYTES // 100
    out = tmp_path / "out"
    calls = [["info", "--freq", path], ["doctor", path], ["du", path],
             ["convert", path, out.with_suffix(".bag")], ["convert", out.with_suffix(".bag"), out.with_suffix(".mcap")],
             ["filter", path, tmp_path / "f.mcap", "-t", "/map"], ["merge", path, "-o", tmp_path / "m.bag"],
             ["split", path, tmp_path / "s.mcap", "--count", "1"], ["recover", path, tmp_path / "r.mcap"],
             ["plot", path, tmp_path / "p.svg", "--field", "/map:width"],
             ["attach", out.with_suffix(".mcap"), "-o", tmp_path / "a.mcap", "--metadata", "cell", "name=a"],
             ["export", path, "-o", tmp_path / "e.npz"], ["compare", path, out.with_suffix(".mcap")]]
    tables = [["cat", path], ["export", path, "-o", tmp_path / "e.csv"], ["export", path, "-o", tmp_path / "e.parquet"],
              ["dataset", "add", path, "--to", tmp_path / "set", "--cell", "a"]]
    peaks = run_all(calls + tables)
    assert max(peaks[:len(calls)]) < MOST_BYTES and max(peaks) < MOST_TABLE_BYTES
    source = LogSource([str(path)], frame=bytes)
    played = source.play(None, None)
    assert sorted(len(message.frame) for message in played) == [8, 8, MAP_BYTES + 8]
    played.close()
    source.close()
    for name in ("out.mcap", "m.bag", "r.mcap"):
        assert [len(s.data) for s in read(tmp_path / name)] == [MAP_BYTES + 8, 8, 8]


@pytest.mark.parametrize("writer, codec", [(McapWriter, "zstd"), (BagWriter, "bz2")])
def test_a_message_that_readers_would_not_unpack_is_stored_as_it_is(tmp_path, monkeypatch, writer, codec):
    monkeypatch.setattr("jaka_bag.containers.compression._WINDOW", 1 << 20)
    path = tmp_path / ("big" + (".bag" if writer is BagWriter else ".mcap"))
    with writer(path, codec) as log:
        log.add_message(log.add_channel(MAP), START_NS, map_of(2 << 20).data)
        log.add_message(log.add_channel(STATES), START_NS + 1, bytes(8))
    assert [len(s.data) for s in read(path)] == [(2 << 20) + 8, 8]
    with open_log(path) as reader:
        assert {entry[0] for entry in read_codecs(reader.index)} == {"none", codec}
    assert not is_readable(2 << 20) and is_readable(1 << 20)


@pytest.mark.parametrize("suffix, codec", [(".mcap", "zstd"), (".bag", "lz4")])
def test_many_maps_are_read_in_the_memory_of_a_few(tmp_path, suffix, codec):
    path = write(tmp_path / ("maps" + suffix), [map_of(MAP_BYTES // 3, START_NS + i * 10**9) for i in range(30)], codec)
    assert path.stat().st_size < 30 * MAP_BYTES // 300
    back = tmp_path / ("back" + suffix)
    calls = [["info", "--freq", path], ["doctor", path], ["convert", path, tmp_path / "c.bag"],
             ["convert", path, tmp_path / "c.mcap"], ["convert", path, tmp_path / "c", "--profile", "ros2"],
             ["convert", tmp_path / "c", back], ["filter", path, tmp_path / "f.mcap", "-t", "/map"],
             ["merge", path, "-o", tmp_path / "m.mcap"], ["split", path, tmp_path / "s.mcap", "--count", "1"],
             ["recover", path, tmp_path / "r.mcap"], ["plot", path, tmp_path / "p.svg", "--field", "/map:width"],
             ["compare", path, tmp_path / "c.mcap"]]
    tables = [["cat", path, "--field", "width"], ["export", path, "-o", tmp_path / "e.parquet"],
              ["dataset", "add", path, "--to", tmp_path / "set", "--cell", "a"]]
    peaks = run_all(calls + tables, LOW_LIMIT)
    assert max(peaks[:len(calls)]) < MOST_BYTES and max(peaks) < MOST_TABLE_BYTES
    for name in ("c.bag", "c.mcap", "f.mcap", "m.mcap", "r.mcap", back.name):
        with open_log(tmp_path / name) as reader:
            assert reader.message_count == 30


def test_a_limit_is_called_one_and_can_be_raised(tmp_path, monkeypatch, capsys):
    path = write(tmp_path / "map.mcap", [map_of(3_000_000)])
    monkeypatch.setattr("jaka_bag.containers.compression._WINDOW", 1 << 20)
    words = ["convert", str(path), str(tmp_path / "out.bag"), "-q"]
    for command in (words, ["recover", str(path), str(tmp_path / "r.mcap"), "-q"], ["doctor", str(path)]):
        assert main(command) == 1
        told = "".join(capsys.readouterr())
        assert "a limit, not damage: up to 1 MB are unpacked, and 4 with JAKA_BAG_UNPACK_MB=4 in the env" in told
        assert "recover keeps the rest" not in told and "damaged" not in told
    assert "map.mcap: not read whole: a limit, not damage; 0 messages were read\n" in told
    monkeypatch.setenv("JAKA_BAG_UNPACK_MB", "4")
    assert main(words) == 0
