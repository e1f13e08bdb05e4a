"""Mutants made from the source: each kind is found, a weak test lets one live, and what is chosen is chosen again."""
import json
import shutil
import subprocess
import sys
import textwrap

import generated
import line_tests
import mutate
import pytest
import source_mutants
import yaml

PACKAGE = line_tests.PACKAGE


def changes(text):
    source = textwrap.dedent(text).encode()
    mutants = [one for one in source_mutants.of_source("sums.py", source) if source_mutants.is_change(one, source)]
    return {(one.kind, one.changed) for one in mutants}


@pytest.mark.parametrize("line, kind, changed", [
    ("return a < b", "comparison", "return a >= b"),
    ("return a is not None", "comparison", "return a is None"),
    ("return a not in b", "comparison", "return a in b"),
    ("return 0.0 < a <= b", "comparison", "return 0.0 < a > b"),
    ("return len(a) > b", "comparison", "return len(a) >= b"),
    ("return a and b", "and/or", "return a or b"),
    ("return not a", "not", "return a"),
    ("return all(a)", "any/all", "return any(a)"),
    ("return any(x for x in a if x)", "guard", "return any(x for x in a if True)"),
    ("return 1 if a else b", "guard", "return 1 if not (a) else b"),
    ("return a - b", "arithmetic", "return a + b"),
    ("return -a", "sign", "return a"),
    ("a += b", "arithmetic", "a -= b"),
    ("return 0.5", "constant", "return (0.5 * 2)"),
    ("return 0.5", "constant", "return (0.5 + 1)"),
    ("return 0.5", "constant", "return 0.0"),
    ("a.b = None", "reset", "a.b = a.b"),
    ("a.b = _NEVER", "reset", "a.b = a.b"),
    ("a.b, a.c = b, False", "reset", "a.b, a.c = b, a.c")])
def test_each_kind_is_found(line, kind, changed):
    assert (kind, changed) in changes("def f(a, b):\n    %s\n" % line)


def test_guards_and_early_ends_are_found():
    found = changes("""
        def f(a, b):
            if a:
                return b
            while b:
                continue
            if b:
                raise ValueError(b)
            return a
        """)
    guards = {"if not (a):", "if True:", "if False:", "while False:", "if not (b):"}
    assert {changed for kind, changed in found if kind == "guard"} == guards
    assert [kind for kind, changed in found if changed == "pass"] == ["early end"] and "return a" not in str(found)


def test_constants_and_defaults_outside_of_functions_are_found():
    found = changes("LIMIT = 2\n\n\nclass A:\n    count = 3\n\n    def f(self, a=4):\n        return a\n")
    assert {"LIMIT = (2 * 2)", "count = (3 + 1)", "def f(self, a=0):"} <= {changed for _, changed in found}


@pytest.mark.parametrize("text", [
    '"""Text 1."""\n', "def f(a: Tuple[int, 3]) -> int:\n    pass\n", "def f(a):\n    assert a > 1\n",
    "def f(a):\n    log.warning('%d', a + 1)\n", "class A:\n    def __repr__(self):\n        return 'x' * 3\n",
    "if TYPE_CHECKING:\n    LIMIT = 1\n", "class A(Protocol):\n    limit = 1\n", "def f(a):\n    return 'x' + a\n",
    "def f():\n    raise NotImplementedError\n", "class A:\n    def __init__(self):\n        self.a = None\n"])
def test_what_only_a_reader_would_notice_is_left_alone(text):
    assert not changes(text)


def test_every_mutant_of_the_package_has_a_key_of_its_own():
    mutants = list(source_mutants.of_rooms(PACKAGE))
    assert len({one.key for one in mutants}) == len(mutants) > 5000
    assert {one.kind for one in mutants} == {"comparison", "reset", "guard", "early end", "not", "and/or", "any/all",
                                             "arithmetic", "sign", "constant"}
    for room in source_mutants.ROOMS:
        assert sum(one.file.startswith(room) for one in mutants) > 500


def test_a_key_and_a_sample_outlive_lines_that_are_added(tmp_path):
    (tmp_path / "client").mkdir()
    path = tmp_path / "client" / "sums.py"
    text = "def f(a):\n    return a + 1 if a < 2 else a * 3\n\n\ndef g(a):\n    return a - 4\n"
    path.write_text(text)
    before = source_mutants.sample(tmp_path, list(source_mutants.of_rooms(tmp_path, ["client"])), 5, 7)
    path.write_text('"""Sums."""\n\n' + text)
    every = list(source_mutants.of_rooms(tmp_path, ["client"]))
    assert [one.key for one in source_mutants.sample(tmp_path, every, 5, 7)] == [one.key for one in before]
    assert [one.key for one in source_mutants.sample(tmp_path, every, 5, 8)] != [one.key for one in before]


TESTS = """
    from jaka_ros_driver.client.sums import LIMIT, total


    def test_weak():
        assert total(0) == 0


    def test_strong():
        assert [total(n) for n in range(4)] == [0, 0, 2, 3]
    """


@pytest.fixture
def checkout(tmp_path):
    """Write a checkout of one module, one file of tests, and what measures them."""
    for folder in ("jaka_ros_driver/client", "test/client", "test/mutation", "build"):
        (tmp_path / folder).mkdir(parents=True)
    for folder in ("jaka_ros_driver", "jaka_ros_driver/client"):
        (tmp_path / folder / "__init__.py").write_text("")
    (tmp_path / "jaka_ros_driver/client/sums.py").write_text(textwrap.dedent('''\
        """Sums."""
        LIMIT = 2


        def total(a):
            """The number, from the limit on."""
            if a < LIMIT:
                return 0
            return a
        '''))
    (tmp_path / "pyproject.toml").write_text('[tool.pytest.ini_options]\npythonpath = ["."]\n')
    for path in (mutate.ROOT / "test/mutation").glob("*.py"):
        if not path.name.startswith(("test_", "conftest")):
            shutil.copy(str(path), str(tmp_path / "test/mutation" / path.name))

    def with_tests(text):
        (tmp_path / "test/client/test_sums.py").write_text(textwrap.dedent(text))
        return tmp_path
    return with_tests


TRY = """
    import json, sys
    sys.path.insert(0, "test/mutation")
    import generated, line_tests, mutate, source_mutants
    from pathlib import Path

    known = line_tests.joined(line_tests.read(Path("lines.json")).values())
    mutants = list(source_mutants.of_rooms(line_tests.PACKAGE, ["client"]))
    with mutate.copies(1) as free:
        results = generated.tried(mutants, known, free, json.loads(sys.argv[1]))
        print(json.dumps({one.mutant.changed: one.by for one in results}))
    """


def tried(folder, killers=()):
    """Return the outcome of every mutant, by its changed line; a process of its own has no threads when it forks."""
    subprocess.run([sys.executable, "test/mutation/line_tests.py", "lines.json", "test/client/test_sums.py"],
                   cwd=str(folder), stdout=subprocess.DEVNULL, check=True)
    said = subprocess.run([sys.executable, "-c", textwrap.dedent(TRY), json.dumps(dict(killers))], cwd=str(folder),
                          stdout=subprocess.PIPE, check=True).stdout
    return json.loads(said.splitlines()[-1])


def test_a_weak_test_lets_a_mutant_live_and_a_strong_one_does_not(checkout):
    weak = TESTS[:TESTS.index("def test_strong")]
    results = tried(checkout(weak))
    assert results["if True:"] == "" and results["LIMIT = (2 + 1)"] == ""
    assert results["if False:"] == "" and results["if a >= LIMIT:"] == "", "0 is 0 either way"
    results = tried(checkout(TESTS))
    assert results.pop("return (0 + 1)").startswith("test/client/test_sums.py::test_")
    assert set(results.values()) == {"test/client/test_sums.py::test_strong"}, results


def test_tests_are_recorded_again_when_they_or_what_they_run_has_changed(checkout, monkeypatch, capsys):
    folder = checkout(TESTS)
    package, other = folder / "jaka_ros_driver/client", folder / "test/client/test_other.py"
    package.joinpath("other.py").write_text("def other():\n    return 1\n")
    other.write_text("from jaka_ros_driver.client.other import other\n\n\ndef test_other():\n    assert other()\n")
    monkeypatch.setattr(line_tests, "KEPT", folder / "build" / "lines.json")

    def recorded():
        known = line_tests.known(folder, 2)
        assert set(known.seconds) == {"test/client/test_other.py::test_other", "test/client/test_sums.py::test_weak",
                                      "test/client/test_sums.py::test_strong"}
        return capsys.readouterr().out, known.lines["client/other.py"]

    assert recorded() == ("recording which lines 2 files of tests run ...\n",
                          {2: {"test/client/test_other.py::test_other"}})
    assert recorded()[0] == ""
    package.joinpath("other.py").write_text('"""Other."""\n\n\ndef other():\n    return 1\n')
    assert recorded() == ("recording which lines 1 files of tests run ...\n",
                          {5: {"test/client/test_other.py::test_other"}})
    with other.open("a") as file:
        file.write("    assert other() == 1\n\n\ndef test_that_fails():\n    assert not other()\n")
    for _ in range(2):  # what has failed is recorded again
        assert recorded()[0] == (
            "recording which lines 1 files of tests run ...\n"
            "failed without a mutant, and will notice none in this run: test/client/test_other.py::test_that_fails\n")


def test_verdicts_hold_for_their_state_and_name_the_likely_killer_on_another(tmp_path):
    killed, alive = source_mutants.of_source("sums.py", b"def f(a):\n    return a + 1\n")[:2]
    before = generated.Verdicts(tmp_path / "build" / "verdicts.jsonl", "a state")
    before.add(generated.Tried(killed, "test/test_sums.py::test_f", 3, 1.5))
    before.add(generated.Tried(alive, "", 2, 0.5))
    same = generated.Verdicts(tmp_path / "build" / "verdicts.jsonl", "a state")
    assert same.known == {killed.key: ("test/test_sums.py::test_f", 3, 1.5), alive.key: ("", 2, 0.5)}
    assert same.is_known(killed, 9) and same.is_known(alive, 2) and not same.is_known(alive, 3)
    another = generated.Verdicts(tmp_path / "build" / "verdicts.jsonl", "another state")
    assert not another.known and another.killers == {killed.key: "test/test_sums.py::test_f"}


@pytest.mark.parametrize("path, is_another", [
    ("jaka_ros_driver/client/sums.py", True), ("test/client/test_sums.py", True), ("test/client/sums.yaml", True),
    ("test/mutation/equivalent.yaml", False), ("test/__pycache__/sums.pyc", False), ("README.md", False)])
def test_a_state_is_that_of_the_code_and_its_tests(checkout, path, is_another):
    folder = checkout(TESTS)
    before = generated.state_of(folder)
    (folder / path).parent.mkdir(exist_ok=True)
    (folder / path).write_text("# changed\n")
    assert (generated.state_of(folder) != before) is is_another


@pytest.mark.parametrize("killer", ["test_strong", "test_that_is_gone"])
def test_the_test_that_killed_a_mutant_before_is_tried_first_while_it_is_there(checkout, killer):
    results = tried(checkout(TESTS), {"client/sums.py | total | return 0 | return (0 + 1)":
                                      "test/client/test_sums.py::" + killer})
    by = results["return (0 + 1)"]
    assert by == "test/client/test_sums.py::test_strong" if killer == "test_strong" else by.startswith("test/client/")


def test_the_tests_of_a_line_are_those_that_run_it_fastest_first():
    known = line_tests.LineTests({"slow": 2.0, "fast": 0.1, "other": 0.0},
                                 {"sums.py": {2: {"slow", "fast"}, 3: {"other"}}})
    mutant = source_mutants.of_source("sums.py", b"def f(a):\n    return a + 1\n")[0]
    assert known.of(mutant) == ["fast", "slow"]


def test_whole_files_of_slow_tests_come_last_and_others_only_while_there_is_time():
    known = line_tests.LineTests({"a": 1.0, "b": generated.LONGEST_TESTS_S, "c": 2 * generated.LONGEST_TESTS_S},
                                 {"ros/node.py": {2: {"a", "b", "c"}}})
    mutant = source_mutants.of_source("ros/node.py", b"def f(a):\n    return a + 1\n")[0]
    tests, seconds = generated.chosen_tests(known, mutant, mutate.ROOT)
    assert tests == ["a", *line_tests.LIVE["ros/node.py"]]
    assert seconds > 1.0, "the files take time, too"


def test_what_is_listed_as_equivalent_has_a_reason():
    rows = yaml.safe_load(generated.EQUIVALENT.read_text(encoding="utf-8"))
    assert all(len(row["mutant"]) in (4, 5) and len(row["why"]) > 10 for row in rows)
    assert len(generated.equivalents()) == len(rows)


def test_files_of_slow_tests_and_the_modules_they_stand_for_are_there():
    for module, tests in line_tests.LIVE.items():
        assert (PACKAGE / module).exists() and all((mutate.ROOT / test).exists() for test in tests), module
