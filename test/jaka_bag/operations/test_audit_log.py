"""``jaka_bag verify`` on the driver's audit log: whole logs pass, and the first line that was touched is named."""
import hashlib
import json
import os
import random
import subprocess
import sys
import zlib
from types import SimpleNamespace

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from jaka_bag.cli import main as command
from jaka_bag.operations import audit_log
from jaka_bag.operations.audit_log import verify_audit
from jaka_ros_driver.audit.log import AuditLog

COUNT = 12
MEMORY_BYTES = 64 << 20


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """Write a driver's log; return names and bytes of its files: some lines in each of four files."""
    folder = tmp_path_factory.mktemp("log")
    for count in range(4):
        log = AuditLog(str(folder), 0, file_bytes=450)
        log.start()
        for number in range(3):
            log.write("end" if count == 3 and number == 2 else "call", {"number": number, "text": "x" * 20})
        assert log.close(20.0)
    files = {path.name: path.read_bytes() for path in sorted(folder.glob("*.jsonl"))}
    assert len(files) == 4 and all(data.count(b"\n") == 3 for data in files.values())
    return files


@pytest.fixture
def log(written, tmp_path):
    """Copy it: a folder, whose lines a test changes."""
    return Log(tmp_path / "copy", written)


class Log:
    def __init__(self, folder, files):
        folder.mkdir(exist_ok=True)
        self.folder = folder
        self.names = sorted(files)
        self.put({name: data.split(b"\n")[:-1] for name, data in files.items()})

    def put(self, files):
        """Write these lines; the files are these and no others."""
        self.files = files
        for path in self.folder.glob("*.jsonl"):
            path.unlink()
        for name, lines in files.items():
            (self.folder / name).write_bytes(b"".join(line + b"\n" for line in lines))

    def verified(self):
        account, = verify_audit([str(self.folder)])
        return account

    def where(self):
        """Return (index of the file, line) of the first defect, and its text."""
        defect = self.verified().defect
        assert defect is not None
        return self.names.index(os.path.basename(defect.path)), defect.line, defect.what


def sealed(fields):
    """Return a line with a right checksum, as somebody makes it who knows the format."""
    body = json.dumps(fields).encode()[:-1]
    return body + b',"crc":"%08x"}' % zlib.crc32(body)


def hash_of(line):
    return hashlib.sha256(line).hexdigest()


def test_a_whole_log_passes_and_its_last_hash_is_told(log, capsys):
    account = log.verified()
    assert (account.lines, account.files, account.defect, account.notes) == (COUNT, 4, None, ())
    assert account.last_hash == hash_of(log.files[log.names[-1]][-1])
    assert command.main(["verify", str(log.folder)]) == 0
    said = capsys.readouterr().out
    assert "12 lines in 4 files, from 20" in said and said.rstrip().endswith("whole; last hash " + account.last_hash)


@pytest.mark.parametrize("file", range(4))
@pytest.mark.parametrize("line", range(3))
def test_one_changed_byte_is_named_in_whichever_line(log, file, line):
    chance = random.Random(10 * file + line)
    name = log.names[file]
    path = log.folder / name
    whole = path.read_bytes()
    begin = sum(len(text) + 1 for text in log.files[name][:line])
    for place in chance.sample(range(len(log.files[name][line]) + 1), 25):  # the line end, too
        changed = bytearray(whole)
        changed[begin + place] ^= chance.randrange(1, 256)
        path.write_bytes(bytes(changed))
        found_file, found_line, what = log.where()
        assert (found_file, found_line) == (file, line + 1), (place, what)
        assert what.split()[0].rstrip(":,") in ("changed", "foreign", "cut"), what
    path.write_bytes(whole)
    assert log.verified().defect is None


def test_a_line_that_was_rewritten_with_its_checksum_is_named(log):
    for file, line in ((0, 0), (1, 1), (2, 2)):
        files = {name: list(lines) for name, lines in log.files.items()}
        name = log.names[file]
        fields = json.loads(files[name][line])
        fields.pop("crc")
        files[name][line] = sealed(dict(fields, text="forged"))
        other = Log(log.folder, {name: b"".join(text + b"\n" for text in lines) for name, lines in files.items()})
        assert other.where()[:2] == (file, line + 1) and "changed" in other.where()[2]


def test_the_last_line_rewritten_with_its_checksum_shows_in_the_last_hash_alone(log):
    before = log.verified().last_hash
    files = dict(log.files)
    fields = json.loads(files[log.names[-1]][-1])
    fields.pop("crc")
    files[log.names[-1]] = [*files[log.names[-1]][:-1], sealed(dict(fields, text="forged"))]
    log.put(files)
    account = log.verified()
    assert account.defect is None and account.last_hash != before


@pytest.mark.parametrize("file, line", [(file, line) for file in range(4) for line in range(3)])
def test_a_line_that_was_deleted_is_missing(log, file, line):
    files = {name: list(lines) for name, lines in log.files.items()}
    del files[log.names[file]][line]
    log.put(files)
    if (file, line) == (3, 2):  # at the very end nothing follows that would show it, but the driver's end is not there
        account = log.verified()
        assert account.defect is None and any("end is not in it" in note for note in account.notes)
        return
    number = 3 * file + line + 1
    expected = (file, line + 1) if line < 2 else (file + 1, 1)
    found_file, found_line, what = log.where()
    assert (found_file, found_line) == expected and what.startswith("missing: lines %d to %d" % (
        1 if number == 1 else number, number)), what


def test_lines_that_were_swapped_are_out_of_order(log):
    for file, line in ((0, 1), (1, 0), (2, 1)):
        files = {name: list(lines) for name, lines in log.files.items()}
        lines = files[log.names[file]]
        lines[line], lines[line + 1] = lines[line + 1], lines[line]
        other = Log(log.folder, {name: b"".join(text + b"\n" for text in lines) for name, lines in files.items()})
        assert other.where()[:2] == (file, line + 1) and other.where()[2].startswith("out of order: line %d" % (
            3 * file + line + 1))


@pytest.mark.parametrize("line, words", [
    (b"hello", "foreign"), (b"", "foreign"), (b"{}", "foreign"), (b"\0\xff", "foreign"),
    (sealed({"n": 5}), "foreign: it has no number"), (sealed({"n": "5", "prev": ""}), "foreign: it has no number"),
    (b'{"n":5,"prev":"","v":NaN,"crc":"%08x"}' % zlib.crc32(b'{"n":5,"prev":"","v":NaN'), "foreign: not JSON: NaN"),
    (b'{"n":5,"prev":"","v":-Infinity,"crc":"%08x"}' % zlib.crc32(b'{"n":5,"prev":"","v":-Infinity'), "not JSON"),
    (b"[" * 100000, "foreign: longer"), (b"[" * 15000 + b',"crc":"%08x"}' % zlib.crc32(b"[" * 15000), "not JSON"),
    (b"x" * 5000000, "foreign: longer")],
    ids=range(11))
def test_a_foreign_line_is_named(log, line, words):
    files = {name: list(lines) for name, lines in log.files.items()}
    files[log.names[1]].insert(1, line)
    log.put(files)
    assert log.where()[:2] == (1, 2) and words in log.where()[2], log.where()


def test_a_line_that_was_inserted_with_all_its_hashes_is_noticed(log):
    files = {name: list(lines) for name, lines in log.files.items()}
    before = files[log.names[1]][0]
    files[log.names[1]].insert(1, sealed({"n": 5, "prev": hash_of(before), "kind": "call"}))
    log.put(files)
    assert log.where()[:2] == (1, 3) and "number 5 comes again" in log.where()[2]


def test_a_line_that_is_there_twice_is_noticed(log):
    files = {name: list(lines) for name, lines in log.files.items()}
    files[log.names[2]].insert(1, files[log.names[2]][0])
    log.put(files)
    assert log.where()[:2] == (2, 2) and "number 7 comes again" in log.where()[2]


@pytest.mark.parametrize("file", range(3))
def test_a_file_that_is_gone_is_missing(log, file):
    (log.folder / log.names[file]).unlink()
    assert log.where() == (file + 1, 1, "missing: lines %d to %d%s" % (
        (3 * file + 1, 3 * file + 3, "") if file else (1, 3, ", which no later line says were pruned")))


def test_files_that_were_renamed_and_swapped_are_out_of_order(log):
    one, two = (log.folder / log.names[n] for n in (1, 2))
    content = one.read_bytes()
    one.write_bytes(two.read_bytes())
    two.write_bytes(content)
    assert log.where()[:2] == (1, 1) and log.where()[2].startswith("out of order: line 4")


def test_a_cut_tail_and_an_empty_file_are_told(log):
    path = log.folder / log.names[-1]
    whole = path.read_bytes()
    path.write_bytes(whole[:-20])
    assert log.where()[:2] == (3, 3) and log.where()[2].startswith("cut: the last line is not whole")
    path.write_bytes(b"")
    assert log.where() == (3, 1, "cut: the file is empty")
    path.write_bytes(whole)
    middle = log.folder / log.names[1]
    middle.write_bytes(middle.read_bytes()[:-20])  # nobody went on there
    assert log.where()[:2] == (1, 3) and log.where()[2].startswith("changed")


def test_a_line_that_says_what_was_cut_is_believed_for_these_bytes_only(log):
    rest = b'{"n":12,"pre'
    files = {name: list(lines) for name, lines in log.files.items()}
    lines = files[log.names[-1]]
    told = sealed({"n": 12, "prev": hash_of(lines[1]), "kind": "cut", "bytes": len(rest), "sha256": hash_of(rest)})
    for content, is_whole in (([rest, told], True), ([rest + b"x", told], False), ([rest, b"", told], False),
                              ([told], False), ([rest], False)):
        log.put({**files, log.names[-1]: lines[:2] + content})
        assert (log.verified().defect is None) is is_whole, content


def test_some_files_alone_may_begin_anywhere(log):
    account, = verify_audit([str(log.folder / name) for name in log.names[1:3]])
    assert account.defect is None and account.lines == 6 and "it begins with line 4" in account.notes
    account, = verify_audit([str(log.folder / log.names[0]), str(log.folder / log.names[2])])
    assert account.defect.what == "missing: lines 4 to 6"


def test_each_folder_is_a_log_of_its_own(log, written, tmp_path, capsys):
    Log(tmp_path / "other", written)
    assert len(verify_audit([str(tmp_path)])) == 2
    assert command.main(["verify", str(tmp_path)]) == 0
    (tmp_path / "other" / log.names[0]).unlink()
    assert command.main(["verify", str(tmp_path)]) == 1
    said = capsys.readouterr().out
    assert "%s: line 1: missing: lines 1 to 3" % os.path.join(str(tmp_path), "other", log.names[1]) in said


@pytest.mark.parametrize("make, words", [
    (lambda folder: str(folder / "none.jsonl"), "no such file"), (lambda folder: str(folder), "no audit log is in"),
    (lambda folder: os.mkfifo(str(folder / "pipe.jsonl")) or str(folder / "pipe.jsonl"), "no regular file")])
def test_what_is_no_log_is_an_error(tmp_path, capsys, make, words):
    assert command.main(["verify", make(tmp_path)]) == 1
    assert words in capsys.readouterr().err


def test_a_huge_line_takes_no_memory(log):
    path = log.folder / log.names[1]
    with open(str(path), "ab") as file:
        file.truncate(file.tell() + 8 * MEMORY_BYTES)  # one line of zeros
    script = ("import sys; from jaka_bag.operations.audit_log import verify_audit;"
              "account, = verify_audit(sys.argv[1:]); print(account.defect.line, account.defect.what);"
              "print([line.split()[1] for line in open('/proc/self/status') if line.startswith('VmHWM')][0])")
    ended = subprocess.run([sys.executable, "-c", script, str(log.folder)], stdout=subprocess.PIPE, text=True,
                           check=True, timeout=120, env=dict(os.environ, PYTHONPATH=os.pathsep.join(sys.path)))
    said, kilobytes = ended.stdout.strip().splitlines()
    assert said.startswith("4 foreign: longer") and int(kilobytes) * 1024 < 2 * MEMORY_BYTES


@settings(max_examples=200, suppress_health_check=list(HealthCheck), deadline=None)
@given(data=st.binary(max_size=300), place=st.floats(0.0, 1.0), removed=st.integers(0, 300))
def test_whatever_is_put_in_or_taken_out_is_found(log, data, place, removed):
    path = log.folder / log.names[1]
    whole = b"".join(line + b"\n" for line in log.files[log.names[1]])
    begin = int(place * len(whole))
    changed = whole[:begin] + data + whole[begin + removed:]
    path.write_bytes(changed)
    assert (log.verified().defect is None) is (changed == whole)


def test_a_log_that_grows_meanwhile_is_not_called_cut(log, monkeypatch):
    path = log.folder / log.names[-1]
    whole = path.read_bytes()
    path.write_bytes(whole[:-20])
    # In this module alone: another thread of the tests that slept would write the file while it is read.
    monkeypatch.setattr(audit_log, "time", SimpleNamespace(sleep=lambda _: path.write_bytes(whole)))
    assert log.verified().defect is None


def test_a_folder_of_which_only_the_lock_is_left_is_a_defect(log, capsys):
    (log.folder.parent / "bare").mkdir()
    (log.folder.parent / "bare" / "lock").touch()
    assert command.main(["verify", str(log.folder.parent)]) == 1
    said = capsys.readouterr().out
    assert "bare" in said and "no file of this log is left" in said and "12 lines in 4 files" in said
    assert command.main(["verify", str(log.folder.parent / "bare")]) == 1


def test_a_folder_that_cannot_be_read_is_named(log, capsys, monkeypatch):
    closed = log.folder.parent / "closed"
    closed.mkdir()
    scandir = os.scandir

    def refuse(path):  # root reads every folder
        if os.path.basename(str(path)) == "closed":
            raise PermissionError(13, "Permission denied", str(path))
        return scandir(path)
    monkeypatch.setattr(os, "scandir", refuse)
    assert command.main(["verify", str(log.folder.parent)]) == 1
    assert "closed" in "".join(capsys.readouterr())
