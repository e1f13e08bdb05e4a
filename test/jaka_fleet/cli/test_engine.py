"""The place of the work on many logs: chosen by its size, unless the options say it, and told in the first line."""
import argparse
import subprocess

import pytest
from command_places import command_of
from fleet_logs import write_plant

from jaka_bag.engines.dask_engine import Dask
from jaka_bag.engines.processes import Processes
from jaka_bag.engines.tasks import LogTask, Serial
from jaka_bag.errors import UsageError
from jaka_fleet.cli import engine
from jaka_fleet.cli.engine import choose_engine

WORTH = 10_000_000


def chosen(folder, count, size, **options):
    """Return the choice for so many logs of so many bytes, on a computer of two processors."""
    tasks = []
    for number in range(count):
        path = folder / ("%d.mcap" % number)
        with path.open("wb") as log:
            log.truncate(size)
        tasks.append(LogTask(str(path)))
    return choose_engine(argparse.Namespace(**{"jobs": None, "dask": None, **options}), tasks, WORTH)


@pytest.mark.parametrize("count, size, options, kind, words", [
    (2, 1000, {}, Serial, "2 logs, 2.0 kB: one at a time, in this process"),
    (2, 4_600_000, {}, Processes, "2 logs, 9.2 MB: 2 at a time, in processes of this computer"),
    (2, 4_200_000, {}, Serial, "2 logs, 8.4 MB: one at a time, in this process"),
    (20, 1000, {}, Processes, "20 logs, 20.0 kB: 2 at a time, in processes of this computer"),
    (1, 20_000_000, {}, Serial, "1 log, 20.0 MB: one at a time, in this process"),
    (2, 1000, {"jobs": 2}, Processes, "2 logs, 2.0 kB: 2 at a time, in processes of this computer"),
    (2, 20_000_000, {"jobs": 1}, Serial, "2 logs, 40.0 MB: one at a time, in this process"),
    (1, 1000, {"dask": "tcp://head:8786"}, Dask, "1 log, 1.0 kB: on the Dask scheduler tcp://head:8786")],
    ids=["little", "much", "not much", "many", "one", "asked for", "asked to be alone", "elsewhere"])
def test_the_size_of_the_work_chooses_where_no_option_does(tmp_path, monkeypatch, count, size, options, kind, words):
    monkeypatch.setattr(engine.os, "cpu_count", lambda: 2)
    choice = chosen(tmp_path, count, size, **options)
    assert isinstance(choice.engine, kind) and choice.words == words


def test_one_processor_has_no_workers(tmp_path, monkeypatch):
    monkeypatch.setattr(engine.os, "cpu_count", lambda: 1)
    assert isinstance(chosen(tmp_path, 20, 20_000_000).engine, Serial)


def test_a_count_and_an_address_do_not_go_together(tmp_path):
    with pytest.raises(UsageError, match="not for a cluster elsewhere"):
        chosen(tmp_path, 1, 1000, jobs=2, dask="tcp://head:8786")


def test_the_program_tells_it_in_its_first_line(tmp_path):
    write_plant(tmp_path / "logs", 2, 1)
    size = sum(path.stat().st_size for path in (tmp_path / "logs").rglob("*.mcap"))

    def run(*words):
        done = subprocess.run([*command_of("jaka_bag"), *words], cwd=str(tmp_path), stdout=subprocess.PIPE, text=True,
                              timeout=120)
        assert done.returncode in (0, 1), "2: it could not be done"
        return done.stdout.splitlines()

    first, last = run("dataset", "add", "logs", "--to", "fleet")
    assert first == "2 logs, %.1f kB: one at a time, in this process" % (size / 1000)
    assert last.startswith("fleet: 2 logs added")
    assert run("dataset", "add", "logs", "--to", "fleet", "-q") == []
    golden = next((tmp_path / "logs").rglob("*.mcap"))
    first = run("compare", str(golden), "--against", "fleet", "--results", "results")[0]
    assert first == "2 logs, %.1f kB: one at a time, in this process" % (size / 1000)
