"""The end of a recording: signed and told of, whatever ended it."""
import argparse
import json
from contextlib import contextmanager

import pytest
from live_samples import string_connection

from jaka_bag.cli import record
from jaka_bag.cli.notices import Notices
from jaka_bag.errors import BagError, WriteFailed


@contextmanager
def recording(tmp_path, monkeypatch, error):
    """Yield a recording of one message that an error ends, in the thread of the session."""
    parser = argparse.ArgumentParser()
    record.add_arguments(parser)
    args = parser.parse_args(["/b", "-O", str(tmp_path / "log"), "--report", str(tmp_path / "report.json"),
                              "--format", "mcap"])
    monkeypatch.setattr(record, "RemoteNode", Master)
    monkeypatch.setattr(record, "wait_for_master", lambda *arguments: True)
    with Notices("jaka_bag record", False) as console:
        recorder = record.LogRecording(args, "/log", console)

        def run(connect, use_clock):
            recorder.writer.start()
            stream = recorder.writer.open_stream(string_connection("/b"), "http://n/")
            recorder.writer.take(stream, 10**9, b"x")
            recorder.writer.finish()
            raise error

        prepare = recorder.prepare

        def prepared(*arguments):
            prepare(*arguments)
            recorder._session.run = run

        recorder.prepare = prepared
        yield recorder


class Master:
    """A master that knows no parameter."""

    def __init__(self, *arguments):
        pass

    def call(self, *arguments):
        return None

    def close(self):
        pass


@pytest.mark.parametrize("error", [WriteFailed("log", OSError(5, "Input/output error")),
                                   FileNotFoundError(2, "No such file"), ValueError("wrong")], ids=str)
def test_what_was_recorded_is_signed_and_told_of_whatever_ended_it(tmp_path, monkeypatch, capsys, error):
    with recording(tmp_path, monkeypatch, error) as recorder:
        recorder.key = "key"
        monkeypatch.setattr(record, "sign", lambda path, key: "%s with the %s" % (path, key))
        assert record.record(recorder) == 1
    err = capsys.readouterr().err
    assert "signed: %s with the key" % (tmp_path / "log.mcap") in err and "/b: 1 messages" in err
    assert "error: %s" % error in err and ("Traceback" in err) == isinstance(error, ValueError)
    report = json.loads((tmp_path / "report.json").read_text())
    assert report["messages"] == 1 and report["error"] == str(error)


def test_a_file_that_cannot_be_signed_costs_no_account(tmp_path, monkeypatch, capsys):
    def refuse(path, key):
        raise BagError("cannot read %s" % path)

    with recording(tmp_path, monkeypatch, WriteFailed("log", OSError(5, "Input/output error"))) as recorder:
        recorder.key = "key"
        monkeypatch.setattr(record, "sign", refuse)
        assert record.record(recorder) == 1
    assert "error: cannot read %s" % (tmp_path / "log.mcap") in capsys.readouterr().err
    assert json.loads((tmp_path / "report.json").read_text())["messages"] == 1
