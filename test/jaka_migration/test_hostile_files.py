"""The check of MoveIt configurations on files that are broken, or made to break it: a line each, in bounded time."""
import os
import random
import time

import pytest
from moveit_packages import fitting, makers

from jaka_migration.moveit_config import check, main
from jaka_migration.report import MUST_CHANGE, NOT_READ

YAML, LIMITS, SRDF, URDF, LAUNCH = ("config/controllers.yaml", "config/joint_limits.yaml", "config/press.srdf",
                                    "config/press.urdf", "launch/press.launch")
LONGEST_S = 20.0
"""Longest time of one check, s: some tenths of a second on a free machine."""
BILLION = b"".join(b"%s: &%s [%s]\n" % (b"bcdefghij"[n:n + 1], b"bcdefghij"[n:n + 1], b", ".join([
    b"*" + b"abcdefghi"[n:n + 1]] * 9)) for n in range(9))
ENTITIES = b'<!DOCTYPE r [<!ENTITY a "ha"><!ENTITY b "%s">]>' % (b"&a;" * 1000)
DAMAGE = (b"", b"\n", b"<", b'"', b": ", b"-", b"[", b"\xff", b"9e999", b"-1", b"&a ", b"*a")
HOSTILE = [
    (YAML, b"a: " + b"[" * 5000, "deeper than 60 levels"),
    (YAML, b"- " * 30_000, "deeper than 60 levels"),
    (YAML, b"a: 1\n" * 30_000, "more than 50000 parts"),
    (YAML, b"#" * 500_001, "larger than 500000 bytes"),
    (YAML, b"a: 1\nb: \xff\xfe\n", "no UTF-8: byte 8"),
    (YAML, b"a: [1\nb: 2\n", "is no YAML"),
    (YAML, b"a: *nowhere\n", "is no YAML"),
    (YAML, b"a: \x00\n", "is no YAML"),
    (LIMITS, b"joint_limits: {joint_1: {", "is no YAML"),
    (SRDF, b"<robot>", "is no XML"),
    (SRDF, b"", "is no XML"),
    (SRDF, b"<launch/>", "its root element is launch"),
    (SRDF, ENTITIES + b"<robot>&b;</robot>", "declares a document type"),
    (URDF, b'<!DOCTYPE r SYSTEM "file:///etc/passwd"><robot/>', "declares a document type"),
    (URDF, b'<!DOCTYPE r [<!ENTITY x SYSTEM "/etc/passwd">]><robot name="&x;"/>', "declares a document type"),
    (URDF, b"<robot>" * 100_000, "deeper than 60 levels"),
    (URDF, b"<robot>" + b"<a/>" * 60_000 + b"</robot>", "more than 50000 elements"),
    (URDF, b"<robot>" + b" " * 4_000_000, "larger than 4000000 bytes"),
    (URDF, b'<robot name="\xff"/>', "is no XML"),
    (URDF, b'<?xml version="1.0" encoding="nonsense"?><robot/>', "is no XML"),
    (URDF, b'<?xml version="1.0" encoding="gbk"?><robot/>', "is no XML"),
    (URDF, b'<robot><link name="a"/><link name="b"/><joint name="j" type="fixed"><parent link="a"/><child link="b"/>'
           b'</joint><joint name="k" type="fixed"><parent link="b"/><child link="a"/></joint></robot>',
     "behind itself"),
    (URDF, b"<robot>" + b"".join(b'<link name="%d"/>' % n for n in range(9000)) + b"".join(
        b'<joint name="%d" type="fixed"><parent link="%d"/><child link="%d"/></joint>' % (n, n, n + 1)
        for n in range(8999)) + b"</robot>", "more than 300 links in a row"),
    (LAUNCH, b"<launch><node></launch>", "is no XML"),
    (LAUNCH, b"<robot/>", "is no launch file"),
]


def in_time(package, **options):
    began = time.monotonic()
    report = check(str(package), **options)
    assert time.monotonic() - began < LONGEST_S
    return report


@pytest.mark.parametrize("file, content, told", HOSTILE, ids=[str(n) for n in range(len(HOSTILE))])
def test_a_file_that_cannot_be_read_is_a_line(tmp_path, file, content, told):
    package = fitting(tmp_path)
    (package / file).write_bytes(content)
    report = in_time(package, model_name="zu7")
    finding, = [one for one in report.of(NOT_READ) if one.file == file]
    assert told in finding.text and report.is_broken
    assert report.exit_code == (1 if report.of(MUST_CHANGE) else 2)


def test_aliases_are_not_multiplied(tmp_path):
    package = fitting(tmp_path)
    path = package / YAML
    bomb = b"a: &a [x, x, x, x, x, x, x, x, x]\n" + BILLION
    path.write_bytes(bomb + path.read_bytes() + b"  - name: *j\n    joints: *j\n")
    report = in_time(package)
    assert [one.text for one in report.of(MUST_CHANGE)] == ["a controller without name"]


def test_arguments_are_not_multiplied(tmp_path):
    package = fitting(tmp_path)
    wide = "<arg name='b' default='%s'/><arg name='a' default='%s'/>" % ("x" * 900_000, "$(arg b)" * 100_000)
    used = "<param name='moveit_controller_manager' value='$(arg a)'/>"
    (package / LAUNCH).write_text("<launch>%s%s</launch>" % (wide, used))
    assert max(len(one.text) for one in in_time(package).findings) < 2000


def test_what_is_no_file_is_not_waited_for(tmp_path):
    package = fitting(tmp_path)
    for name, make in ((YAML, os.mkfifo), (LIMITS, os.mkdir), (SRDF, lambda path: os.symlink("/dev/zero", path))):
        (package / name).unlink()
        make(str(package / name))
    report = in_time(package, model_name="zu7")
    told = {one.file: one.text for one in report.of(NOT_READ)}
    assert told == dict.fromkeys((YAML, LIMITS, SRDF), "is no regular file")


def test_names_move_no_cursor(tmp_path, capsys):
    package = fitting(tmp_path)
    path = package / SRDF
    path.write_bytes(path.read_bytes().replace(b'link1="Link_0"', b'link1="&#9;&#xD;\xc2\x9b2J%s"' % (b"x" * 5000)))
    assert main([str(package)]) == 1
    said = capsys.readouterr().out
    assert "\x9b" not in said and "\r" not in said and max(map(len, said.splitlines())) < 2000


def test_damaged_packages_give_a_report_each(tmp_path):
    """Cut, change and shuffle bytes of every file, by one seed."""
    draw = random.Random(20261127)
    package = makers(tmp_path, "zu7")
    files = [*package.rglob("*.*"), *tmp_path.glob("jaka_description/urdf/*"), *tmp_path.glob("jaka_planner/launch/*")]
    files = [path for path in files if path.is_file()]
    assert len(files) == 13
    for path in files:
        whole = path.read_bytes()
        for _ in range(8):
            damaged = bytearray(whole[:draw.randrange(len(whole))] if draw.random() < 0.3 else whole)
            for _ in range(draw.randrange(1, 6)):
                where = draw.randrange(len(damaged) + 1)
                damaged[where:where + draw.randrange(3)] = draw.choice([*DAMAGE, bytes([draw.randrange(256)])])
            path.write_bytes(bytes(damaged))
            report = in_time(package, model_name="zu7")
            assert report.as_text() and report.as_json()
        path.write_bytes(whole)
