"""A conversion is a short walk: few files of the package, one open and one look at the format of its input."""
import os
import re
import sys
from typing import NamedTuple, Tuple

import pytest
from call_tracer import CallTracer
from import_graph import ROOT
from log_samples import state_log, write

import jaka_bag
from jaka_bag.cli.main import main
from jaka_bag.containers import registry

PACKAGE = os.path.dirname(os.path.abspath(jaka_bag.__file__))
PAGE = ROOT / "docs" / "architecture.md"


class Kind(NamedTuple):
    """One way to convert: from a suffix, to a suffix, with more words; some files that it passes."""

    source: str
    target: str
    words: Tuple[str, ...]
    passes: Tuple[str, ...]

    @property
    def row(self) -> str:
        """The beginning of its row in the page's table."""
        return "| `%s` | %s |" % (self.source, "`%s`" % self.target if self.target else "a rosbag2 folder")


KINDS = {kind.source + " to " + (kind.target or "a rosbag2 folder"): kind for kind in (
    Kind(".bag", ".mcap", (), ("containers/mcap/writer.py",)),
    Kind(".mcap", ".bag", (), ("containers/bag/writer.py",)),
    Kind(".bag", "", ("--profile", "ros2"), ("messages/cdr.py",)),
    Kind(".mcap", "", ("--profile", "ros2"), ("messages/cdr.py",)))}


@pytest.fixture(params=sorted(KINDS))
def kind(request):
    return KINDS[request.param]


@pytest.fixture
def log(tmp_path, kind):
    """Write a log; everything that its conversion imports is imported."""
    path = write(tmp_path / ("log" + kind.source), state_log(2.0))
    convert(path, "first", kind)
    return path


def convert(log, name, kind):
    output = log.with_name(name + kind.target)
    assert main(["convert", str(log), "-o", str(output), "-q", *kind.words]) == 0


def files_of_a_conversion(log, kind):
    """Return the files of the package whose functions run, in this thread and in those that it starts."""
    tracer = CallTracer(PACKAGE)
    tracer.follow_here_and_in_new_threads()
    try:
        with tracer:
            convert(log, "second", kind)
    finally:
        tracer.follow_no_more()
    return sorted(tracer.files)


def told_by_the_page():
    """Return the number of files of each row of the page's table of conversions, by the beginning of the row."""
    table = PAGE.read_text(encoding="utf-8").partition("<!-- conversions -->")[2].partition("<!-- end -->")[0]
    return {row: int(number) for row, number in re.findall(r"^(\|.*\|) (\d+) \|$", table, re.MULTILINE)}


def test_the_page_tells_of_every_kind():
    assert set(told_by_the_page()) == {kind.row for kind in KINDS.values()}


def test_a_conversion_passes_as_many_files_as_the_page_says(log, kind):
    files = files_of_a_conversion(log, kind)
    assert {"operations/convert.py", *kind.passes} <= set(files), files  # the threads are followed, too
    assert len(files) == told_by_the_page()[kind.row], files


def test_a_conversion_opens_its_input_once_and_looks_at_its_format_once(log, kind, monkeypatch):
    opened, looked_at = [], []
    detect = registry.detect_format

    def detect_format(path, descriptor):
        looked_at.append(str(path))
        return detect(path, descriptor)

    monkeypatch.setattr(registry, "detect_format", detect_format)
    is_at_work = [True]

    def listen(event, arguments):  # an audit hook stays to the end of the process
        if is_at_work[0] and event == "open" and str(arguments[0]) == str(log):
            opened.append(str(log))

    sys.addaudithook(listen)
    convert(log, "second", kind)
    is_at_work[0] = False
    assert opened == looked_at == [str(log)]
