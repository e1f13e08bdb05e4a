"""Texts of nothing but brackets: refused before a parser reaches the end of Python's stack, where 3.8 may abort."""
import json
import subprocess
import sys

import pytest
import yaml

from jaka_bag import json_text, yaml_text
from jaka_bag.json_text import load_json
from jaka_bag.yaml_text import BoundedLoader
from jaka_ros_driver.errors import FramingError, InvalidCommand
from jaka_ros_driver.protocol import framing
from jaka_ros_driver.yaml_text import DEEPEST, load_yaml

AT_THE_EDGE = """
import gc, sys
def down(calls):
    if calls:
        down(calls - 1)
gc.callbacks.append(lambda phase, info: down(20))  # as a finaliser that calls other code
gc.set_threshold(10)
sys.path[:0] = sys.argv[1:3]
%s
for count in range(400, 1300, 30):
    try:
        read(%s * count)
    except Exception as error:
        refused = error
print(type(refused).__name__)
"""
"""A process that collects garbage at each depth of its stack."""


@pytest.mark.parametrize("reader, unit, error", [
    ("from jaka_ros_driver.yaml_text import load_yaml as read", "'[\\n'", "InvalidCommand"),
    ("from jaka_bag.yaml_text import load_yaml as read", "'[\\n'", "ComposerError"),
    ("from jaka_bag.json_text import load_json as read", "'['", "ValueError"),
    ("from jaka_bag.json_text import load_json as read", "'{\"a\":'", "ValueError"),
    ("from jaka_ros_driver.protocol.framing import parse_object as read", "b'{\"a\":'", "FramingError"),
    ("from jaka_ros_driver.protocol.framing import parse_object as read", "b'['", "FramingError"),
    ("from jaka_ros_driver.simulation.server.request_parser import RequestParser\n"
     "def read(text): raise RequestParser().feed(text, 0.0)[0]", "b'{\"a\":'", "FramingError")])
def test_a_finaliser_at_the_end_of_the_stack_ends_no_process(reader, unit, error, root):
    done = subprocess.run([sys.executable, "-c", AT_THE_EDGE % (reader, unit), str(root), str(root / "tools")],
                          capture_output=True, text=True, timeout=300)
    assert (done.returncode, done.stdout) == (0, error + "\n"), done.stderr[-2000:]


@pytest.mark.parametrize("opened, closed", [("[", "]"), ('{"a[[": ', "}"), ('["\\\\\\"[", ', "]")])
def test_json_of_the_most_levels_is_read_and_of_one_more_refused(opened, closed):
    def nested(levels):
        return opened * levels + '"[{"' + closed * levels

    text = nested(json_text.DEEPEST)
    for form in (text, text.encode(), text.encode("utf-16")):
        assert load_json(form) == json.loads(text)
    assert load_json('"%s"' % ("[" * 600)) == "[" * 600
    flat = "[%s]" % ",".join([nested(1)] * json_text.DEEPEST)
    assert load_json(flat) == json.loads(flat)
    for form in (nested(json_text.DEEPEST + 1), nested(json_text.DEEPEST + 1).encode()):
        with pytest.raises(ValueError, match="deeper than 500 levels"):
            load_json(form)


@pytest.mark.parametrize("text", ["[", '"[', "[1, 2", "]" * 600, "nan,", ""])
def test_what_is_no_json_is_as_before(text):
    with pytest.raises(ValueError) as expected:
        json.loads(text)
    with pytest.raises(ValueError) as found:
        load_json(text)
    assert str(found.value) == str(expected.value)


@pytest.mark.parametrize("read, error", [(load_yaml, InvalidCommand), (yaml_text.load_yaml, yaml.YAMLError)])
def test_yaml_of_the_most_levels_is_read_and_of_one_more_refused(read, error):
    assert DEEPEST == yaml_text.DEEPEST
    assert read("[" * DEEPEST + "]" * DEEPEST) == yaml.safe_load("[" * DEEPEST + "]" * DEEPEST)
    assert read("[" * (DEEPEST - 1) + "1" + "]" * (DEEPEST - 1))
    for text in ("[" * (DEEPEST + 1) + "]" * (DEEPEST + 1), "[" * DEEPEST + "1" + "]" * DEEPEST, "- " * 100, "? " * 100,
                 "{a: " * 100):
        with pytest.raises(error, match="deeper than 60 levels"):
            read(text)


def test_an_object_of_the_most_levels_is_read_and_of_one_more_refused():
    text = b'{"a":' * framing.DEEPEST + b'"[{\\"["' + b"}" * framing.DEEPEST
    assert framing.parse_object(text) == json.loads(text)
    wide = b'{"a":[%s]}' % b",".join([b"[1]"] * framing.DEEPEST)
    assert framing.parse_object(wide) == json.loads(wide)
    with pytest.raises(FramingError, match="not a JSON object but str"):
        framing.parse_object(b'"%s"' % (b"[" * (framing.DEEPEST + 1)))
    with pytest.raises(FramingError, match="deeper than 500 levels"):
        framing.parse_object(b'{"a":' + text + b"}")


def chain(length):
    return "".join("x%d: &x%d [%s]\n" % (i, i, "*x%d" % (i - 1) if i else "") for i in range(length))


def test_levels_that_aliases_stand_for_count():
    assert yaml.load(chain(DEEPEST - 1), BoundedLoader) == yaml.safe_load(chain(DEEPEST - 1))
    for text in (chain(DEEPEST), chain(5000), "a: &a [*a]", "&a {b: {c: *a}}"):
        with pytest.raises(yaml.YAMLError, match="deeper than 60 levels|holds itself"):
            yaml.load(text, BoundedLoader)
