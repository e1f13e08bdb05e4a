"""The cell's data as all pages share it, with a disk that does not answer."""
import asyncio
import json
import threading
from types import SimpleNamespace

from waiting import happens

from jaka_panel.cell.contents import CellData, text_of
from jaka_panel.pages import shared_cell
from jaka_panel.pages.shared_cell import SharedCell

ARM = "/jaka_driver"
POINT = {"q": [0.1, 1, -1.5, 1.5, 1.5, 0.0]}
CHANGE = {"section": "points", "arm": ARM, "name": "P1", "entry": POINT}


def test_a_first_reading_that_takes_too_long_is_made_up_for(tmp_path, monkeypatch):
    monkeypatch.setattr(shared_cell, "_LIMIT_S", 0.3)
    monkeypatch.setattr(shared_cell, "_LOOK_S", 0.05)
    file, log = tmp_path / "cell.json", tmp_path / "cell.audit"

    async def work():
        told = []
        cell = SharedCell(str(file), False, told.append)
        read, released = cell._file._read, threading.Event()
        cell._file._read = lambda: (released.wait(20.0), read())
        following = asyncio.ensure_future(cell.follow_for_ever())
        await asyncio.sleep(0.6)  # twice the time limit of a reading
        released.set()
        await happens(lambda: told and any(path.stat().st_size for path in log.glob("*")), "it is read and logged")
        file.write_text(text_of(CellData(7, "2026-01-01T00:00:00Z", "an editor", {"points": {ARM: {"P1": POINT}}})))
        await happens(lambda: "P1" in cell.told, "the new file is read")
        assert told[-1]["revision"] == 7
        following.cancel()
        await cell.close()

    asyncio.new_event_loop().run_until_complete(asyncio.wait_for(work(), 30.0))


def test_a_disk_that_does_not_answer_holds_up_neither_the_loop_nor_the_other_pages(tmp_path):
    released = threading.Event()

    async def work():
        told = []
        cell = SharedCell(str(tmp_path / "cell.json"), False, told.append)
        following = asyncio.ensure_future(cell.follow_for_ever())
        await happens(lambda: told, "the cell is read")
        write = cell._file._write
        cell._file._write = lambda *args: (released.wait(20.0), write(*args))
        page = SimpleNamespace(id="p1", name="Ann", address="", may_command=True, has_token=True)
        change = asyncio.ensure_future(cell.change(page, {"revision": 0, "changes": [CHANGE]}))
        await asyncio.sleep(0.2)  # the disk does not answer meanwhile
        assert not change.done() and json.loads(cell.told)["revision"] == 0
        released.set()
        assert (await change).data == {"revision": 1} and told[-1]["revision"] == 1
        assert json.loads(cell.told)["data"] == {"points": {ARM: {"P1": POINT}}}
        following.cancel()
        await cell.close()

    try:
        asyncio.new_event_loop().run_until_complete(asyncio.wait_for(work(), 30.0))
    finally:
        released.set()
