"""A conversion is a short walk: few files of the package, one open and one look at the format of its input."""
import os
import sys
import threading
from pathlib import Path

import pytest
from log_samples import state_log, write

import jaka_bag
from jaka_bag.cli.main import main
from jaka_bag.containers import registry

PACKAGE = os.path.dirname(os.path.abspath(jaka_bag.__file__))
MOST_FILES = 15


@pytest.fixture
def log(tmp_path):
    """A .bag; all that its conversion imports is imported."""
    path = write(tmp_path / "log.bag", state_log(2.0))
    assert main(["convert", str(path), "-o", str(tmp_path / "first.mcap"), "-q"]) == 0
    return path


def files_of_a_conversion(log):
    """Files of the package whose functions run."""
    seen = set()

    def look(frame, event, argument):
        if event == "call" and frame.f_code.co_name != "<module>":
            seen.add(os.path.abspath(frame.f_code.co_filename))

    threading.setprofile(look)
    sys.setprofile(look)
    try:
        assert main(["convert", str(log), "-o", str(log.with_name("second.mcap")), "-q"]) == 0
    finally:
        sys.setprofile(None)
        threading.setprofile(None)
    return sorted(Path(name).relative_to(PACKAGE).as_posix() for name in seen if name.startswith(PACKAGE + os.sep))


def test_a_conversion_passes_few_files(log):
    files = files_of_a_conversion(log)
    assert "operations/convert.py" in files and "containers/mcap/writer.py" in files  # the threads are followed, too
    assert len(files) <= MOST_FILES, files


def test_a_conversion_opens_its_input_once_and_looks_at_its_format_once(log, monkeypatch):
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
    assert main(["convert", str(log), "-o", str(log.with_name("second.mcap")), "-q"]) == 0
    is_at_work[0] = False
    assert opened == looked_at == [str(log)]
