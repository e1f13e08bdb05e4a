import json
import struct
import subprocess
import sys

import numpy as np
import pytest
from command_places import command_of
from log_samples import JOINTS, START_NS, STATES, TOOL, Sample, joints, state_log, states, tool, write

from jaka_bag.cli.main import main
from jaka_bag.containers.mcap.writer import McapWriter
from jaka_bag.containers.registry import read_index
from jaka_bag.operations.timing import Timing

SAMPLES = state_log(2.0)


def info(capsys, *words):
    assert main(["info", *map(str, words)]) == 0
    return capsys.readouterr().out


@pytest.mark.parametrize("suffix, codec", [(".bag", "lz4"), (".bag", "none"), (".mcap", "zstd")])
def test_the_facts(tmp_path, suffix, codec, capsys):
    path = write(tmp_path / ("log" + suffix), SAMPLES, codec)
    document = json.loads(info(capsys, "--json", path))
    assert document["messages"] == len(SAMPLES) and document["size"] == path.stat().st_size
    assert document["start_ns"] == START_NS and document["end_ns"] == max(s.time for s in SAMPLES)
    assert document["format"] == suffix[1:]
    assert [(c["codec"], c["chunks"]) for c in document["compression"]] == [(codec, document["chunks"])]
    by_topic = {t["topic"]: t for t in document["topics"]}
    assert by_topic[TOOL.topic]["messages"] == 250 and by_topic[TOOL.topic]["md5sum"] == TOOL.md5sum
    assert by_topic["/model"]["latching"] and by_topic["/model"]["callers"] == ["/launch"]
    text = info(capsys, path)
    for word in ("duration", "751", codec, TOOL.topic, TOOL.datatype, JOINTS.md5sum, "(latched)", "Hz"):
        assert word in text


def test_several_files_and_single_values(tmp_path, capsys):
    a, b = write(tmp_path / "a.bag", SAMPLES), write(tmp_path / "b.mcap", SAMPLES[:5])
    assert info(capsys, a, b).count("path:") == 2
    assert info(capsys, "-k", "messages", a, b) == "751\n5\n"
    assert main(["info", "-k", "nope", str(a)]) == 2


def test_an_empty_log_has_no_times(tmp_path, capsys):
    text = info(capsys, write(tmp_path / "none.mcap", []))
    assert "messages:     0" in text and "duration" not in text


def test_attachments_metadata_and_what_the_recorder_lost(tmp_path, capsys):
    with McapWriter(tmp_path / "log.mcap") as writer:
        writer.add_attachment("params.yaml", b"a: 1", "application/yaml")
        account = {"missing": 3, "overflowed": 0, "undelivered": None}
        writer.add_metadata("jaka_bag.drops", {STATES.topic: json.dumps(account)})
        writer.add_message(writer.add_channel(STATES), START_NS, bytes(8))
    text = info(capsys, tmp_path / "log.mcap")
    assert "params.yaml (application/yaml, 4 B)" in text and "jaka_bag.drops" in text
    assert "LOST, says the recorder: 3 missing by header.seq" in text


def test_rate_jitter_and_gaps_from_the_index(tmp_path, capsys):
    regular = [states(START_NS + i * 8_000_000, 1, 1, 0, 0) for i in range(1000) if i not in (500, 501, 502)]
    odd = [tool(i, START_NS + i * i * 1_000_000, [0.0] * 6) for i in range(50)]
    path = write(tmp_path / "log.bag", sorted(regular + odd, key=lambda s: s.time))
    document = json.loads(info(capsys, "--freq", "--json", path))
    found = {t["topic"]: t["freq"] for t in document["topics"]}
    timing = found[STATES.topic]
    assert timing["rate"] == pytest.approx(124.6, abs=0.1) and timing["median_interval"] == pytest.approx(0.008)
    assert (timing["gaps"], timing["missing"]) == (1, 3)
    assert timing["largest_gap"] == pytest.approx(0.032)
    assert timing["largest_gap_at_ns"] == START_NS + 499 * 8_000_000
    assert found[TOOL.topic]["missing"] is None
    assert "1 gaps (~3 missing)" in info(capsys, "--freq", path)


def timing_of(times):
    timing = Timing()
    timing.add(times)
    return timing.document()


def test_timing_of_few_or_equal_times():
    assert timing_of(np.array([5]))["text"] == "too few messages for a rate"
    assert timing_of(np.array([5, 5, 5]))["rate"] is None
    assert timing_of(np.arange(10) * 10**7)["jitter_p99"] == 0


def test_skipped_sequence_numbers_are_counted_for_each_publisher(tmp_path, capsys):
    numbers = [0, 1, 2, 5, 6, 0, 1, 9]  # two gaps, and a publisher that started anew
    samples = [joints(n, START_NS + i, [0.0]) for i, n in enumerate(numbers)] + [states(START_NS + 9, 0, 0, 0, 0)]
    path = write(tmp_path / "log.bag", samples)
    document = json.loads(info(capsys, "--seq", "--json", path))
    found = {t["topic"]: t.get("seq") for t in document["topics"]}
    assert (found[JOINTS.topic]["missing"], found[JOINTS.topic]["gaps"]) == (9, 2)
    assert found[STATES.topic] is None
    assert "9 missing at 2 places" in info(capsys, "--seq", path)


def test_info_imports_neither_numpy_nor_a_codec_nor_what_only_writing_needs(tmp_path, root):
    paths = [str(write(tmp_path / name, SAMPLES)) for name in ("log.bag", "log.mcap")]
    code = ("import sys\nbefore = set(sys.modules)\nfrom jaka_bag.cli.main import main\n"
            "assert main(['info'] + sys.argv[1:]) == 0\n"
            "print(sorted({'numpy', 'lz4', 'zstandard', 'rosbags', 'mcap', 'json', 'pathlib', 'shutil', 'traceback'}\n"
            "             & set(sys.modules) - before))")
    out = subprocess.check_output([sys.executable, "-c", code] + paths, cwd=str(root))
    assert out.decode().splitlines()[-1] == "[]"


def test_names_that_are_not_utf8_are_printed_escaped(tmp_path, root):
    odd = STATES._replace(topic=b"/caf\xe9".decode("utf-8", "surrogateescape"))
    path = write(tmp_path / "odd.bag", [Sample(odd, START_NS, struct.pack("<4h", 0, 0, 0, 0))])
    assert read_index(path).connections == [odd]
    done = subprocess.run([*command_of("jaka_bag"), "info", str(path)], cwd=str(root),
                          stdout=subprocess.PIPE)
    assert done.returncode == 0 and b"/caf\\udce9" in done.stdout
