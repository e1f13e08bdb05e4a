"""The table of mutants, which fits the code, and their verdicts. ``tools/dev mutate`` tries all of them."""
import collections
import shutil

import mutate
import pytest
from mutant import Mutant, mutated, path_of
from mutants import MUTANTS

ROOMS = ("protocol", "client", "ros", "kinematics", "trajectory", "clearance")


def test_every_mutant_fits_one_place_of_its_file_and_leaves_it_python():
    wrong = []
    for mutant in MUTANTS:
        text = path_of(mutate.ROOT, mutant).read_text(encoding="utf-8")
        try:
            changed = mutated(mutant, text)
            compile(changed, mutant.file, "exec")
            if changed == text:
                wrong.append("%s: changes nothing" % mutant.name)
        except (ValueError, SyntaxError) as error:
            wrong.append(str(error))
    assert not wrong, "\n".join(wrong)


def test_every_mutant_has_a_name_of_its_own_and_tests_that_are_there():
    names = collections.Counter(mutant.name for mutant in MUTANTS)
    assert set(names.values()) == {1}, names.most_common(3)
    missing = {test for mutant in MUTANTS for test in mutant.tests if not (mutate.ROOT / test.split("::")[0]).exists()}
    assert not missing and all(mutant.tests for mutant in MUTANTS), missing


def test_there_are_mutants_of_every_room():
    rooms = collections.Counter(mutant.file.split("/")[0] for mutant in MUTANTS)
    assert set(rooms) == {*ROOMS, "commands.py"} and min([rooms[room] for room in ROOMS]) >= 10, rooms


@pytest.fixture
def checkout(tmp_path):
    """Write a package of one function and its test."""
    (tmp_path / "jaka_ros_driver").mkdir()
    (tmp_path / "jaka_ros_driver" / "sums.py").write_text("def total(a, b):\n    return a + b\n")
    (tmp_path / "test_sums.py").write_text(
        "import sys\nsys.path.insert(0, 'jaka_ros_driver')\nimport sums\n\n\n"
        "def test_total():\n    assert sums.total(2, 2) == 4\n")
    (tmp_path / "pytest.ini").write_text("[pytest]\n")
    return tmp_path


@pytest.mark.parametrize("new, time_limit, is_killed, by", [
    ("a - b", 100.0, True, "test_sums.py::test_total"),
    ("a * b", 100.0, False, ""),
    ("a +", 100.0, True, "test_sums.py"),
    ("[0 for _ in iter(int, 1)]", 2.0, True, "its time limit of 2 s")],
    ids=["killed", "alive", "cannot be imported", "hangs"])
def test_a_verdict_is_what_the_tests_say_and_the_mutant_is_undone(checkout, new, time_limit, is_killed, by):
    path = checkout / "jaka_ros_driver" / "sums.py"
    original = path.read_text()
    verdict = mutate.try_mutant(checkout, Mutant("m", "sums.py", "a + b", new, ("test_sums.py",)), time_limit)
    assert (verdict.is_killed, verdict.by) == (is_killed, by)
    assert path.read_text() == original


def test_tests_that_are_not_there_kill_nothing(checkout):
    with pytest.raises(mutate.CannotTell):
        mutate.run_tests(checkout, ["test_products.py"])


def test_mutants_are_applied_to_copies(monkeypatch, tmp_path):
    checkout = tmp_path / "checkout"
    (checkout / "build").mkdir(parents=True)
    (checkout / "code.py").write_text("pass\n")
    monkeypatch.setattr(mutate, "ROOT", checkout)
    with mutate.copies(2) as free:
        folders = [free.get(), free.get()]
        assert len({*folders, checkout}) == 3
        for folder in folders:
            assert [path.name for path in folder.iterdir()] == ["code.py"]
            shutil.rmtree(str(folder))
    assert (checkout / "code.py").exists()


def test_mutants_are_chosen_by_their_name_or_file():
    assert mutate.chosen([]) == MUTANTS
    mutant = MUTANTS[0]
    assert mutant in mutate.chosen([mutant.name]) and mutant in mutate.chosen([mutant.file])
    assert not mutate.chosen(["no mutant is called so"])


def test_slow_tests_give_a_mutant_more_time():
    mutant = Mutant("m", "sums.py", "a", "b", ("test/a.py::test_one", "test/a.py::test_two", "test/b"))
    assert mutate.time_limit(mutant, {"test/a.py": 1.0, "test/b": 2.0}) == mutate.TIME_LIMIT_S
    assert mutate.time_limit(mutant, {"test/a.py": 100.0, "test/b": 50.0}) == 600.0


def test_tests_that_fail_without_a_mutant_end_the_check(monkeypatch, checkout):
    (checkout / "test_sums.py").write_text("def test_total():\n    assert False\n")
    monkeypatch.setattr(mutate, "ROOT", checkout)
    with pytest.raises(mutate.CannotTell, match="without a mutant these fail: test_sums.py::test_total"):
        mutate.report([Mutant("m", "sums.py", "a + b", "a - b", ("test_sums.py",))], 1)


def test_a_row_names_the_test_or_says_that_the_mutant_is_alive(monkeypatch, checkout, capsys):
    monkeypatch.setattr(mutate, "ROOT", checkout)
    mutants = [Mutant("wrong sign", "sums.py", "a + b", "a - b", ("test_sums.py",)),
               Mutant("a product", "sums.py", "a + b", "a * b", ("test_sums.py",))]
    assert mutate.report(mutants, 2) == 1
    rows = capsys.readouterr().out.splitlines()
    assert rows[:2] == ["wrong sign  sums.py  test_sums.py::test_total", "a product   sums.py  ALIVE"]
    assert rows[2].startswith("2 mutants, 1 killed, 1 alive")
