"""The pytest plugin's report folders: one for each log of each test."""
from types import SimpleNamespace

from jaka_regression.pytest_plugin import _Case


class Config:
    """The part of pytest's configuration that the plugin asks for."""

    def __init__(self, folder):
        self._folder = str(folder)

    def getoption(self, name, default=None):
        return self._folder if name == "--jaka-reports" else default


def folders(config, node, count=1):
    case = _Case(SimpleNamespace(config=config, node=SimpleNamespace(nodeid=node), path="/tests/test_a.py"))
    return [case.next_folder() for _ in range(count)]


def test_no_two_tests_share_a_folder(tmp_path):
    config = Config(tmp_path)
    found = [*folders(config, "test_a.py::test_b[x y]", 2), *folders(config, "test_a.py::test_b[x_y]"),
             *folders(config, "test_a.py::test_b[x/y]"), *folders(config, "test_a.py::test_b[x y]_2")]
    assert len(set(found)) == len(found)
    assert found[0] == tmp_path / "test_a.py_test_b_x_y" and found[1] == tmp_path / "test_a.py_test_b_x_y__2"


def test_a_test_that_is_repeated_uses_its_folder_again(tmp_path):
    config = Config(tmp_path)
    first = folders(config, "test_a.py::test_b[x y]", 2)
    folders(config, "test_a.py::test_b[x_y]")
    assert folders(config, "test_a.py::test_b[x y]", 2) == first
    assert folders(Config(tmp_path), "test_a.py::test_b[x_y]") == first[:1]
