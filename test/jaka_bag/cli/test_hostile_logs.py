"""Logs made to do harm: each command ends soon, in bounded memory, with a result or one line of explanation."""
import json
import struct
import subprocess
import sys
from pathlib import Path

import pytest
import zstandard
from hostile_logs import HEAVY, HOSTILE, MOST_BYTES, MOST_CPU_S, RUN_ALL, make, mcap_with_chunks
from log_samples import BREAK, START_NS, Sample, connection, read, write
from mcap_variants import record

from jaka_bag.cli import main as command
from jaka_bag.cli.main import main
from jaka_bag.containers.compression import Allowance
from jaka_bag.containers.registry import open_log
from jaka_bag.errors import BagFormatError, DefinitionError, LimitReached
from jaka_bag.messages.definitions import definition_md5, parse_definition


@pytest.fixture(scope="module")
def corpus(tmp_path_factory):
    folder = tmp_path_factory.mktemp("hostile")
    make(folder, [name for name in HOSTILE if name not in HEAVY or name.startswith("bz2")])
    assert all(path.stat().st_size <= 1 << 20 for path in folder.iterdir())
    return folder


def commands(log: Path, out: Path):
    return [["info", "--freq", "--seq"], ["convert", "-o", out / "a.mcap", "--force"],
            ["convert", "-o", out / "ros2", "--profile", "ros2", "--force"],
            ["filter", "-o", out / "b.mcap", "-t", "/x", "--force"], ["merge", "-o", out / "c.bag", "--force"],
            ["split", "-o", out / "d.mcap", "--count", "1000000", "--force"], ["recover", out / "e.mcap", "--force"],
            ["export", "-o", out / "f", "--force"], ["compare", log]]


def test_every_command_stays_within_bounds(corpus, tmp_path):
    logs = {name: (corpus / name).read_bytes() for name in HOSTILE if name not in HEAVY}
    calls = [[str(word) for word in [words[0], corpus / name] + words[1:]] for name in logs
             for words in commands(corpus / name, tmp_path)]
    done = subprocess.run([sys.executable, "-c", RUN_ALL, json.dumps(calls)], capture_output=True, timeout=180)
    assert done.returncode == 0, done.stderr[-2000:]
    for words, (code, seconds, most) in zip(calls, json.loads(done.stdout.splitlines()[-1])):
        assert code in (0, 1, 2) and seconds < MOST_CPU_S and most < MOST_BYTES, (words, code, seconds, most)
    assert b"Traceback" not in done.stderr and b"\x1b" not in done.stdout + done.stderr, done.stderr[-2000:]
    assert {name: (corpus / name).read_bytes() for name in logs} == logs


@pytest.mark.parametrize("name", ["bz2_claims_1000.bag", "zstd_claims_1000.mcap"])
def test_address_space_of_500_mb_beyond_the_start_is_enough(corpus, tmp_path, name):
    code = ("import resource, sys\nfrom jaka_bag.cli.main import main\nfrom jaka_bag.operations import recover\n"
            "import numpy, zstandard\nused = int(open('/proc/self/statm').read().split()[0]) * 4096\n"
            "resource.setrlimit(resource.RLIMIT_AS, (used + %d, used + %d))\nsys.exit(main(sys.argv[1:]))"
            % (MOST_BYTES, MOST_BYTES))
    for words in (["recover", str(tmp_path / "out.mcap")],):
        done = subprocess.run([sys.executable, "-c", code, words[0], str(corpus / name)] + words[1:],
                              capture_output=True, timeout=100)
        assert done.returncode in (0, 1) and b"Traceback" not in done.stderr, done.stderr
        assert b"memory" not in done.stderr


def test_a_chunk_is_unpacked_to_what_it_claims_and_no_further(corpus):
    for name, reason in (("bz2_claims_1000.bag", "instead of 1000"), ("lz4_claims_1000.bag", "instead of 1000"),
                         ("bz2_claims_4_gb.bag", "JAKA_BAG_UNPACK_MB")):
        with pytest.raises(BagFormatError, match=reason), open_log(corpus / name) as reader:
            reader.load(reader.chunks[0])


def spent(size, messages=0, payload=0):
    allowance = Allowance(1000)
    for position in (0, 0, 1):  # the first chunk is read twice, and counts once
        allowance.spend(position, size, messages, payload)
    return allowance


def test_what_chunks_hold_beyond_messages_is_limited_and_the_limit_can_be_raised(monkeypatch):
    spent(5 << 30, 10, 5 << 30).check()
    spent(250 << 20).check()
    with pytest.raises(LimitReached, match="a limit, not damage.* JAKA_BAG_UNPACK_MB=546"):
        spent(260 << 20).check()
    monkeypatch.setenv("JAKA_BAG_UNPACK_MB", "21000")
    spent(9 << 30).check()
    for meaningless in ("²", "9" * 5000, "-1", "many"):
        monkeypatch.setenv("JAKA_BAG_UNPACK_MB", meaningless)
        with pytest.raises(LimitReached):
            spent(9 << 30).check()


def test_chunks_without_messages_end_a_reading_at_the_limit(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr("jaka_bag.containers.compression._BARREN_FLOOR", 1 << 20)
    monkeypatch.setattr("jaka_bag.containers.compression._BARREN_RATIO", 0)
    unknown = record(0x7f, bytes(1 << 20))
    path = tmp_path / "barren.mcap"
    path.write_bytes(mcap_with_chunks("zstd", [zstandard.compress(unknown)] * 4, len(unknown)))
    for words in (["convert", str(path), str(tmp_path / "out.bag"), "-q"], ["doctor", str(path)]):
        assert main(words) == 1
        told = "".join(capsys.readouterr())
        assert "a limit, not damage: up to 1 MB are unpacked" in told and "damaged" not in told


def test_damages_in_an_open_chunk_cost_no_more_than_themselves(corpus, tmp_path, capsys):
    assert main(["recover", str(corpus / "damages.bag.active"), str(tmp_path / "found.bag"), "-q"]) == 1
    assert capsys.readouterr().err.count("a record is damaged") == 3000
    assert [struct.unpack("<II", s.data)[0] for s in read(tmp_path / "found.bag")] == list(range(1, 6000, 2))


def test_definitions_are_limited_where_they_are_read(corpus):
    from hostile_logs import deep, doubling
    for kind, reason in ((doubling(), "more than 5000 fields|deep"), (deep(), "types deep")):
        with pytest.raises(DefinitionError, match=reason):
            definition_md5(kind.datatype, kind.definition)
    chain = "a/N0 a\n" + "".join(BREAK + "MSG: a/N%d\na/N%d a\n" % (i, i + 1) for i in range(40)) + BREAK + (
        "MSG: a/N40\nuint8 v\n")
    assert len(parse_definition("a/T", chain)) == 42
    shortcuts = "".join("a/N%d f%d\n" % (i, i) for i in range(199, -1, -1)) + "".join(
        BREAK + "MSG: a/N%d\na/N%d a\n" % (i, i + 1) for i in range(199)) + BREAK + "MSG: a/N199\nuint8 v\n"
    with pytest.raises(DefinitionError, match="types deep"):
        parse_definition("a/T", shortcuts)


def test_topics_cannot_steer_the_terminal(corpus, capsys):
    assert main(["info", str(corpus / "escapes.bag")]) == 0
    out = capsys.readouterr().out
    assert "\x1b" not in out and "\x9b" not in out and "/x\\x1b]0;owned\\x07\\x1b[2J\\x9b31m" in out


def test_an_odd_account_of_the_recorder_is_said_to_be_damaged(corpus, capsys):
    for name in HOSTILE:
        if name.startswith("account"):
            assert main(["info", str(corpus / name)]) == 1
            assert "account of losses is damaged" in capsys.readouterr().err


def test_a_comparison_that_fails_is_no_difference(tmp_path, monkeypatch, capsys):
    log = write(tmp_path / "log.mcap", [Sample(connection("/x", "a/B", "uint8 v\n"), START_NS, b"x")])

    def fail(error):
        class Broken:
            add_arguments = staticmethod(lambda parser: parser.add_argument("files", nargs="*"))

            @staticmethod
            def run(args):
                raise error
        monkeypatch.setattr(command, "load_command", lambda name: Broken)

    for error in (ZeroDivisionError("oops"), MemoryError(), OSError(28, "full"), RecursionError()):
        fail(error)
        assert main(["compare", str(log), str(log)]) == 2
    fail(MemoryError())
    assert main(["merge", str(log)]) == 1
    assert "not enough memory" in capsys.readouterr().err
