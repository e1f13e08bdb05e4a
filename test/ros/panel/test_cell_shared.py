"""The data of the cell on a panel: shared by all pages, changed by those with the token alone, within budgets."""
import json
import re
import signal
import subprocess
import time

import pytest
from command_places import command_of
from panel_page import Page, PanelProcess

ARM = "/cell/jaka_driver"
POINT = {"q": [0.1, 1.0, -1.5, 1.5, 1.5, 0.0]}


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    return tmp_path_factory.mktemp("cell") / "data" / "cell.json"


@pytest.fixture(scope="module")
def panel(ros_node, place):
    with PanelProcess("--cell-data", str(place)) as panel:
        yield panel


def set_point(name, entry=POINT):
    return {"section": "points", "arm": ARM, "name": name, "entry": entry}


def fetch(page):
    """Return all data of the cell, as a page asks for them."""
    before = len(page.messages)
    page.send(t="cell")
    return page.wait("cell", since=before)


def settled(page):
    """Wait until the panel has read its file; return its revision."""
    told = fetch(page)
    if told["problem"]:
        told = page.wait("cell_changed", lambda m: not m["problem"])
    return told["revision"]


def upload(page, text, revision, size=20000):
    parts = [text[at:at + size] for at in range(0, len(text), size)]
    for number, part in enumerate(parts, 1):
        answer = page.command("cell_upload", None, revision=revision, part=number, parts=len(parts), text=part)
        if not answer["ok"]:
            break
    return answer


def test_a_change_reaches_all_pages_and_a_stale_one_none(loop, panel, place):
    with Page(loop, panel, name="Ann") as ann, Page(loop, panel, name="<b>") as other, \
            Page(loop, panel, token=None) as visitor:
        revision = settled(ann)
        answer = ann.command("cell_change", None, revision=revision, changes=[set_point("P1")])
        assert answer["ok"] and answer["data"] == {"revision": revision + 1}, answer
        for page in (ann, other, visitor):
            told = page.wait("cell_changed", lambda m: m["changes"])
            assert told["revision"] == revision + 1 and told["by"] == "Ann" and told["changes"] == [set_point("P1")]
            assert fetch(page)["data"] == {"points": {ARM: {"P1": POINT}}}
        stale = other.command("cell_change", None, revision=revision, changes=[set_point("P2"), set_point("P1", None)])
        assert not stale["ok"] and stale["data"] == {"stale": True, "revision": revision + 1, "present": [
            set_point("P2", None), set_point("P1")]}
        assert other.command("cell_change", None, revision=revision + 1, changes=[set_point("P2")])["ok"]
        assert json.loads(place.read_text())["data"]["points"][ARM] == {"P1": POINT, "P2": POINT}
        for cmd in ("cell_change", "cell_upload", "cell_restore", "cell_export", "cell_versions", "present_pose"):
            assert "token" in visitor.command(cmd, None)["message"]


@pytest.mark.parametrize("args", [
    {}, {"changes": []}, {"changes": [5] * 201}, {"changes": {}}, {"changes": [{"section": "points"}]},
    {"changes": [set_point("P", {"q": [1e400] * 6})]}, {"changes": [set_point("P", {"q": [0] * 6, "x": 1})]},
    {"changes": [set_point("../../etc/passwd\n")]}, {"changes": [set_point("P")], "revision": 10 ** 400},
    {"changes": [set_point("P")], "revision": "1"}, {"changes": [set_point("P")], "revision": True}])
def test_nonsense_changes_nothing(loop, panel, place, args):
    with Page(loop, panel) as page:
        revision = settled(page)
        answer = page.command("cell_change", None, **{"revision": revision, **args})
        assert not answer["ok"] and answer["message"] and fetch(page)["revision"] == revision
    assert "Traceback" not in "".join(panel.said)


def test_an_export_is_imported_whole_and_a_damaged_one_is_not(loop, panel, place):
    with Page(loop, panel) as page:
        revision = settled(page)
        text = page.command("cell_export", None)["data"]["text"]
        many = json.loads(text)
        many["data"]["points"] = {ARM: {"P%d" % n: POINT for n in range(400)}}
        large = json.dumps(many)
        before = place.read_bytes()
        for damaged, why in ((large[:-5], "no whole JSON"),
                             (large.replace('"version": 1', '"version": 8'), "version 8"),
                             (large + " " * 300000, "longer than")):
            answer = upload(page, damaged, revision)
            assert not answer["ok"] and why in answer["message"], answer
        answer = page.command("cell_upload", None, revision=revision, part=2, parts=2, text="}")
        assert not answer["ok"] and "do not follow" in answer["message"]
        assert place.read_bytes() == before
        assert upload(page, large, revision)["ok"]
        assert len(fetch(page)["data"]["points"][ARM]) == 400
        newest = page.command("cell_versions", None)["data"]["versions"][0]
        assert newest["revision"] == revision
        assert page.command("cell_restore", None, revision=revision + 1, version=revision)["ok"]
        assert fetch(page)["data"] == json.loads(before)["data"]


def test_writes_beyond_the_budget_are_refused_and_the_page_is_served(loop, panel):
    with Page(loop, panel) as page, Page(loop, panel, token=None) as visitor:
        revision = settled(page)
        answers = [page.begin_command("cell_change", None, revision=revision, changes=[set_point("F")])
                   for _ in range(15)]
        answers = [answer() for answer in answers]
        more = [page.begin_command("cell_change", None, revision=revision, changes=[set_point("F")])
                for _ in range(15)]
        answers += [answer() for answer in more]
        assert sum(answer["ok"] for answer in answers) == 1
        assert any("too many changes" in answer["message"] for answer in answers)
        visitor.flood(30, t="cell")
        assert visitor.wait("error")["code"] == "rate"
        assert page.ask("stop", arm=None)["ok"]


def test_a_read_only_panel_shows_the_data_and_changes_none(loop, panel, place):
    with PanelProcess("--cell-data", str(place), "--read-only", name="wall") as wall, Page(loop, wall) as page, \
            Page(loop, panel) as other:
        revision = settled(page)
        answer = page.command("cell_change", None, revision=revision, changes=[set_point("W")])
        assert not answer["ok"] and "read-only" in answer["message"]
        revision = settled(other)
        time.sleep(1.0)  # the budget of writes is spent by the test before: two come each second
        assert other.command("cell_change", None, revision=revision, changes=[set_point("seen on the wall")])["ok"]
        page.wait("cell_changed", lambda m: m["revision"] == revision + 1)
        assert "seen on the wall" in fetch(page)["data"]["points"][ARM]


def test_each_change_is_in_a_log_that_is_verified(loop, panel, place):
    assert panel.end(signal.SIGINT)[0] == 0
    done = subprocess.run([*command_of("jaka_bag"), "verify", str(place.parent / "cell.audit")], capture_output=True,
                          text=True)
    assert done.returncode == 0 and re.search(r"\d+ lines in 1 files.*whole", done.stdout), done.stdout + done.stderr
    lines = [json.loads(line) for line in (place.parent / "cell.audit" / "audit-000000000001.jsonl").open()]
    assert lines[1]["name"] == "Ann" and lines[1]["changes"] == [set_point("P1")]
    assert lines[1]["host"].startswith("127.")
    assert [line["revision"] for line in lines[1:-1]] == list(range(1, len(lines) - 1)) and lines[-1]["kind"] == "end"
