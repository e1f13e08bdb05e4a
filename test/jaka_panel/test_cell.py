"""The file of a cell: what is taken and what is refused, revisions, versions, writes that are whole or not at all."""
import contextlib
import copy
import json
import os
import subprocess
import sys
import threading

import pytest
from import_graph import ROOT
from waiting import eventually

from jaka_bag.operations.audit_log import verify_audit
from jaka_panel.cell.cell_store import KEPT, CellStore, StaleRevision
from jaka_panel.cell.contents import LARGEST, CellData, Change, WrongCell, cell_of, check_change, text_of

ARM = "/left/jaka_driver"
WHO = {"page": "p1", "name": "Ann's tablet", "host": "10.0.0.4:5"}
POINT = {"q": [0.1, 1, -1.5, 1.5, 1.5, 0.0], "model": "zu7", "tool_number": 2, "taken": 1.8e9,
         "tool": {"p": [0.4, 0.1, 0.3], "r": [3.1, 0.0, 0.0]}}
DATA = {
    "io": {ARM: {"cabinet.di.3": {"label": "夹爪 closed"}, "relays.r.0": {"label": "R"}}},
    "points": {ARM: {"P1": POINT, "über <b>": POINT}},
    "user_frames": {ARM: {"table": {"p": [0.1, 0, 0], "r": [0, 0, 1], "number": 2, "residual": 0.0004}}},
    "payloads": {ARM: {"gripper": {"mass": 1.25, "centre": [0, 0, 0.05], "tool": 1}}},
    "lists": {ARM: {"pick": {"steps": [
        {"kind": "joint", "point": "P1", "speed": 0.5}, {"kind": "wait", "s": 1.5},
        {"kind": "arc", "via": "P1", "point": "P1", "speed": 0.1, "blend": 0.01},
        {"kind": "output", "signal": "digital", "bank": "tool", "index": 0, "value": True}]}}},
    "layout": {"": {"desk": {"values": {"drawer": 0.4, "tab": "jog", "open": True}}}}}


def point(name="P1", entry=POINT, arm=ARM):
    return Change("points", arm, name, entry)


@contextlib.contextmanager
def opened(path, is_read_only=False):
    told = []
    cell = CellStore(str(path), is_read_only, lambda state, changes: told.append((state, changes)))
    cell.told = told
    cell.open()
    try:
        yield cell
    finally:
        cell.close()


def whole(**changed):
    return json.dumps({"format": "jaka-cell", "version": 1, "revision": 3, "saved": "", "by": "", "data": DATA,
                       **changed})


def test_a_text_holds_the_same_data_again_and_one_entry_a_line():
    cell = CellData(7, "2026-11-28T18:00:00Z", 'a "name"', DATA)
    text = text_of(cell)
    assert cell_of(text) == cell and json.loads(text)["data"] == DATA
    assert sum(line.strip().startswith(('"P1"', '"über')) for line in text.splitlines()) == 2
    assert cell_of(text_of(CellData(0, "", "", {}))).data == {}


def with_value(value, *place):
    data = copy.deepcopy(DATA)
    target = data
    for key in place[:-1]:
        target = target[key]
    target[place[-1]] = value
    return data


P1 = ("points", ARM, "P1")
WRONG = [
    (with_value([0] * 5, *P1, "q"), "q must be a list of 6"), (with_value("0", *P1, "q"), "q must be a list"),
    (with_value([0, 0, 0, 0, 0, True], *P1, "q"), "must be a number"),
    (with_value([0, 0, 0, 0, 0, 1e9], *P1, "q"), "within -100 to 100 rad"),
    (with_value({"p": [1, 2, 3]}, *P1, "tool"), "tool has no r"), (with_value(2.5, *P1, "tool_number"), "whole number"),
    (with_value("x", *P1, "colour"), "'colour' is not known"), (with_value(5, *P1), "must be an object"),
    (with_value("a\nb", *P1, "model"), "text of one line"),
    (with_value(POINT, "points", ARM, " x"), "is no name"),
    (with_value(POINT, "points", ARM, "__proto__"), "is no name"),
    (with_value(POINT, "points", ARM, "n" * 61), "is no name"),
    (with_value({"P": POINT}, "points", "no arm"), "no name of a driver"),
    (with_value({}, "colours"), "must be one of"),
    (with_value({"label": "x"}, "io", ARM, "cabinet.di.x"), "is no terminal"),
    (with_value({"desk": {"values": {}}}, "layout", ARM), "for all arms"), ([], "data must be an object"),
    (with_value([], "lists", ARM, "pick", "steps"), "1 to 200"),
    (with_value({"steps": [{"kind": "jump"}]}, "lists", ARM, "pick"), "must be one of joint"),
    (with_value(-1.0, "payloads", ARM, "gripper", "mass"), "within 0 to 1000 kg"),
    (with_value({"P%d" % n: POINT for n in range(501)}, "points", ARM), "at most 500 entries")]


@pytest.mark.parametrize("data, why", WRONG, ids=lambda value: value if isinstance(value, str) else "")
def test_data_that_are_none_are_refused_with_the_place(data, why):
    with pytest.raises(WrongCell) as refused:
        cell_of(whole(data=data))
    assert why in str(refused.value)


@pytest.mark.parametrize("text, why", [
    (whole()[:-40], "no whole JSON"), ("", "no whole JSON"),
    (whole(version=2), "version 2; this panel reads version 1"),
    (whole(format="x"), "no file of a cell"), ("[1]", "no file of a cell"), (whole(more=1), "'more' is not known"),
    (whole().replace("1.25", "NaN"), "NaN is no number"), (whole().replace("1.25", "-Infinity"), "is no number"),
    (whole().replace("1.25", "1e999"), "must be a number"), (whole().replace("1.25", "9" * 5000), "5000 digits"),
    (whole().replace('"mass"', '"tool": 2, "mass"'), "'tool' stands twice"), (" " * (LARGEST + 1), "longer than"),
    (whole(by="[[[[[[" * 9)[:-1], "no whole JSON"), ("[" * 100000, "nested too deep"),
    (whole(revision=-1), "whole number"), (whole(revision=True), "whole number")], ids=lambda value: value[-30:])
def test_a_text_that_is_no_cell_is_refused_with_the_reason(text, why):
    with pytest.raises(WrongCell) as refused:
        cell_of(text)
    assert why in str(refused.value)


@pytest.mark.parametrize("change", [
    5, {}, {"section": "x"}, {"section": "points", "arm": ARM, "name": "P", "entry": {}}, {"section": ["points"]},
    {"section": "points", "arm": ARM, "name": None, "entry": POINT}, {"section": "points", "arm": 5, "name": "P"},
    {"section": "points", "arm": ARM, "name": "P", "entry": POINT, "more": 1}])
def test_a_change_that_is_none_is_refused(change):
    with pytest.raises(WrongCell):
        check_change(change, 1)


def test_a_change_names_its_revision_and_a_stale_one_changes_nothing(tmp_path):
    path = tmp_path / "new" / "cell.json"
    with opened(path) as cell:
        assert cell.cell.revision == 0 and not path.exists()
        cell.change(0, [point(), point("P2")], WHO)
        cell.change(1, [point("P1", None), Change("layout", "", "desk", {"values": {}})], WHO)
        text = path.read_bytes()
        with pytest.raises(StaleRevision) as refused:
            cell.change(1, [point("P3")], WHO)
        assert "revision 2 is the present one" in str(refused.value) and path.read_bytes() == text
        assert list(cell.cell.data["points"][ARM]) == ["P2"] and cell.cell.by == "Ann's tablet"
        assert cell.told[-1][1] == [point("P1", None), Change("layout", "", "desk", {"values": {}})]
    with opened(path) as again:
        assert again.cell == cell.cell and not again.problem
        assert sorted(os.listdir(path.parent)) == ["cell.audit", "cell.json", "cell.versions"]


def test_versions_are_kept_restored_and_bounded(tmp_path):
    path = tmp_path / "cell.json"
    with opened(path) as cell:
        for number in range(KEPT + 5):
            cell.change(number, [point("P%d" % number)], WHO)
        versions = cell.versions()
        assert [one["revision"] for one in versions] == list(range(KEPT + 4, 4, -1))
        assert versions[0]["by"] == WHO["name"] and versions[0]["saved"].endswith("Z")
        restored = cell.restore(KEPT + 5, 10, WHO)
        assert restored.revision == KEPT + 6 and len(restored.data["points"][ARM]) == 10
        with pytest.raises(WrongCell):
            cell.restore(KEPT + 6, 3, WHO)
        assert cell_of(cell.text(KEPT + 5)).revision == KEPT + 5


def test_an_import_replaces_all_or_nothing(tmp_path):
    path = tmp_path / "cell.json"
    with opened(path) as cell:
        cell.change(0, [point()], WHO)
        before = path.read_bytes()
        for text in (whole()[:200], whole(version=9), whole(data=WRONG[0][0])):
            with pytest.raises(WrongCell):
                cell.replace(1, text, WHO)
        assert path.read_bytes() == before
        assert cell.replace(1, whole(), WHO).data == DATA and cell.cell.revision == 2
        assert cell_of(cell.text()).data == DATA and cell_of(cell.text(1)).data == {"points": {ARM: {"P1": POINT}}}


def test_too_much_is_refused_and_nothing_is_changed(tmp_path):
    path = tmp_path / "cell.json"
    with opened(path) as cell:
        many = {"steps": [{"kind": "wait", "s": 1.0}] * 200}
        with pytest.raises(WrongCell) as refused:
            cell.change(0, [Change("lists", ARM, "L%d" % n, many) for n in range(60)], WHO)
        assert "at most" in str(refused.value) and not path.exists() and cell.cell.revision == 0


def test_a_file_that_cannot_be_read_is_kept_and_an_import_repairs_it(tmp_path):
    path = tmp_path / "cell.json"
    broken = whole()[:300]
    path.write_text(broken)
    with opened(path) as cell:
        assert "no whole JSON" in cell.problem and cell.cell.data == {}
        with pytest.raises(WrongCell):
            cell.change(cell.cell.revision, [point()], WHO)
        assert path.read_text() == broken
        cell.replace(cell.cell.revision, whole(), WHO)
        assert not cell.problem and cell_of(path.read_text()).data == DATA
        assert broken in [kept.read_text() for kept in (tmp_path / "cell.versions").iterdir()]


def test_what_somebody_else_wrote_is_neither_lost_nor_taken_for_what_pages_know(tmp_path):
    path = tmp_path / "cell.json"
    with opened(path) as cell:
        cell.change(0, [point()], WHO)
        path.write_text(path.read_text().replace("P1", "by hand"))
        with pytest.raises(StaleRevision):
            cell.change(1, [point("P2")], WHO)
        assert list(cell.cell.data["points"][ARM]) == ["by hand"] and cell.told[-1] == (cell.cell, None)
        cell.change(2, [point("P2")], WHO)
        assert list(cell_of(path.read_text()).data["points"][ARM]) == ["by hand", "P2"]
        path.unlink()
        cell.look()
        assert cell.cell.data == {} and cell.cell.revision == 4


def test_the_log_says_who_changed_what_and_shows_a_forged_line(tmp_path):
    path = tmp_path / "cell.json"
    with opened(path) as cell:
        cell.change(0, [point()], WHO)
        cell.replace(1, whole(), WHO)
    folder = tmp_path / "cell.audit"
    (account,) = verify_audit([str(folder)])
    assert account.defect is None and account.lines == 4 and not account.notes
    log = folder / "audit-000000000001.jsonl"
    lines = [json.loads(line) for line in log.read_text().splitlines()]
    assert [(line["kind"], line.get("what")) for line in lines] == [
        ("start", "cell"), ("cell", "change"), ("cell", "import"), ("end", None)]
    assert lines[1]["changes"] == [point()._asdict()] and lines[1]["revision"] == 1
    assert {key: lines[1][key] for key in WHO} == WHO
    log.write_text(log.read_text().replace("Ann", "Bob"))
    assert verify_audit([str(folder)])[0].defect is not None


def test_a_second_writer_and_a_log_that_cannot_be_written_change_nothing(tmp_path):
    path = tmp_path / "cell.json"
    with opened(path) as first:
        first.change(0, [point()], WHO)
        with opened(path) as second, opened(path, is_read_only=True) as watching:
            for other, why in ((second, "another process writes this log"), (watching, "read-only")):
                assert other.cell.data == first.cell.data
                with pytest.raises(WrongCell) as refused:
                    other.change(1, [point("P2")], WHO)
                assert why in str(refused.value)
            first.change(1, [point("P2")], WHO)
            watching.look()
            assert watching.cell == first.cell
            first.close()
            assert eventually(lambda: changed(second, 2, point("P3")), 10.0)
    assert not verify_audit([str(tmp_path / "cell.audit")])[0].defect


def changed(cell, revision, change):
    with contextlib.suppress(WrongCell):
        return cell.change(revision, [change], WHO)


def test_a_full_disk_leaves_the_file_as_it_was(tmp_path, monkeypatch):
    path = tmp_path / "cell.json"
    with opened(path) as cell:
        cell.change(0, [point()], WHO)
        before = path.read_bytes()
        here, fsync = threading.get_ident(), os.fsync

        def full(number):  # for this thread: that of the log may still write the change before
            if threading.get_ident() == here:
                raise OSError(28, "No space left on device")
            fsync(number)
        with monkeypatch.context() as patched:
            patched.setattr(os, "fsync", full)
            with pytest.raises(OSError):
                cell.change(1, [point("P2")], WHO)
        assert path.read_bytes() == before and cell.cell.revision == 1
        assert not (tmp_path / "cell.json.new").exists()


WRITER = """
import sys
sys.path[:0] = %r
from jaka_panel.cell.cell_store import CellStore
from jaka_panel.cell.contents import Change
cell = CellStore(sys.argv[1], False, lambda state, changes: None)
cell.open()
for number in range(100000):
    name = "P%%d" %% (number %% 300)
    cell.change(cell.cell.revision, [Change("points", "/a", name, {"q": [float(number)] * 6})], {"name": "writer"})
    print(cell.cell.revision, flush=True)
"""


def test_a_writer_that_is_killed_leaves_a_whole_file_with_all_that_was_confirmed(tmp_path):
    path = tmp_path / "cell.json"
    code = WRITER % ([str(ROOT), str(ROOT / "tools")],)
    with subprocess.Popen([sys.executable, "-c", code, str(path)], stdout=subprocess.PIPE, text=True) as writer:
        confirmed = 0
        while confirmed < 40:
            confirmed = int(writer.stdout.readline())
        writer.kill()
        confirmed = max([confirmed, *map(int, writer.stdout.read().split())])
    with opened(path) as cell:
        assert not cell.problem and cell.cell.revision in (confirmed, confirmed + 1)
        assert len(cell.versions()) >= 39
