"""A conversion is a short walk: few files of the package, one open and one look at the format of its input."""
import os
import re
import sys
import threading
from pathlib import Path
from typing import NamedTuple, Tuple

import pytest
from import_graph import ROOT
from log_samples import state_log, write

import jaka_bag
from jaka_bag.cli.main import main
from jaka_bag.containers import registry

PACKAGE = os.path.dirname(os.path.abspath(jaka_bag.__file__))
PAGE = ROOT / "docs" / "architecture.md"


class Kind(NamedTuple):
    """One way to convert: from a suffix, to a suffix, with more words; the most files that it may pass, and some."""

    source: str
    target: str
    words: Tuple[str, ...]
    most: int
    passes: Tuple[str, ...]


KINDS = {kind.source + " to " + (kind.target or "a rosbag2 folder"): kind for kind in (
    Kind(".bag", ".mcap", (), 15, ("containers/mcap/writer.py",)),
    Kind(".mcap", ".bag", (), 16, ("containers/bag/writer.py",)),
    Kind(".bag", "", ("--profile", "ros2"), 20, ("messages/cdr.py",)),
    Kind(".mcap", "", ("--profile", "ros2"), 20, ("messages/cdr.py",)))}


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
    """Return the files of the package whose functions run."""
    seen = set()

    def look(frame, event, argument):
        if event == "call" and frame.f_code.co_name != "<module>":
            seen.add(os.path.abspath(frame.f_code.co_filename))

    threading.setprofile(look)
    sys.setprofile(look)
    try:
        convert(log, "second", kind)
    finally:
        sys.setprofile(None)
        threading.setprofile(None)
    return sorted(Path(name).relative_to(PACKAGE).as_posix() for name in seen if name.startswith(PACKAGE + os.sep))


def test_a_conversion_passes_few_files(log, kind):
    files = files_of_a_conversion(log, kind)
    assert {"operations/convert.py", *kind.passes} <= set(files), files  # the threads are followed, too
    assert len(files) <= kind.most, files


def test_the_page_says_how_many_files_each_kind_of_output_passes():
    told = re.search(r"functions of at most (\d+) files of `jaka_bag` to\s`.mcap`, (\d+) to `.bag` and (\d+) to a "
                     r"rosbag2 folder", " ".join(PAGE.read_text(encoding="utf-8").split()))
    assert {target: int(number) for target, number in zip((".mcap", ".bag", ""), told.groups())} == {
        kind.target: kind.most for kind in KINDS.values()}


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
