"""Help, examples, completion and docs/jaka_bag.md are those of the parsers; letters mean one thing."""
import re
import shlex
import shutil
import subprocess
from pathlib import Path

import pytest
from jaka_bag_page import page, shown_options
from peers import COMMANDS as PEER_COMMANDS
from peers import OPTIONS, WITHOUT

from jaka_bag.cli.completion import options_by_command
from jaka_bag.cli.main import COMMANDS, _with_files_first, is_installed, load_command, parser_of

PAGE = Path(__file__).resolve().parents[3] / "docs" / "jaka_bag.md"
PARSERS = {name: parser_of(name, load_command(name), 98) for name in COMMANDS if is_installed(name)}


def test_the_page_is_that_of_the_parsers():
    assert PAGE.read_text() == page(), "build/venv/bin/python3 tools/docs/jaka_bag_page.py > docs/jaka_bag.md"


def test_every_counterpart_is_of_an_option_that_there_is():
    assert set(PEER_COMMANDS) <= set(COMMANDS) and set(OPTIONS) <= set(COMMANDS)
    for name, options in OPTIONS.items():
        there = {max(action.option_strings, key=len) for action in shown_options(PARSERS[name])}
        assert set(options) <= there, name


@pytest.mark.parametrize("name", sorted(PARSERS))
def test_the_help_ends_with_examples_that_are_understood(name):
    epilog = PARSERS[name].epilog or ""
    examples = epilog.partition("examples:\n")[2]
    lines = re.findall(r"^  (?:source <\()?(jaka_bag %s\b[^\n]*)" % name, examples, re.MULTILINE)
    assert len(lines) >= 2, "the help of %s has no two examples" % name
    for line in lines:
        words = shlex.split(re.split(r" \| | > |\)$|   ", line)[0])[1 + len(name.split()):]
        PARSERS[name].parse_intermixed_args(_with_files_first(PARSERS[name], words))


def test_a_letter_means_one_thing():
    meanings = {}
    for parser in PARSERS.values():
        for action in shown_options(parser):
            for word in action.option_strings:
                if len(word) == 2:
                    meanings.setdefault(word, set()).add(max(action.option_strings, key=len))
    several = {letter: names for letter, names in meanings.items() if len(names) > 1}
    assert several == {  # as rosbag has them: record and play, info and play, record beside the commands that write
        "-l": {"--limit", "--loop"}, "-k": {"--key", "--keep-alive"}, "-o": {"--output", "--output-prefix"}}


def test_a_long_name_takes_the_same_kind_of_value_everywhere():
    from jaka_bag.cli import quantities

    times = {"--start": {quantities.time_point}, "--until": {quantities.time_point},
             "--duration": {quantities.positive_ns, quantities.nanoseconds, quantities.duration}}
    for name, parser in PARSERS.items():
        for action in shown_options(parser):
            for word, kinds in times.items():
                assert word not in action.option_strings or action.type in kinds, (name, word)


def test_completion_names_what_help_names():
    for name, words in options_by_command().items():
        assert set(words) - {"-h", "--help"} == {
            word for action in shown_options(PARSERS[name]) for word in action.option_strings}


@pytest.mark.skipif(shutil.which("rosbag") is None, reason="rosbag is not installed")
def test_the_options_of_rosbag_are_all_told_and_none_is_invented():
    told = {}
    for name, options in OPTIONS.items():
        for command in PEER_COMMANDS[name].rosbag.split(", "):
            told.setdefault(command, set()).update(
                re.findall(r"--[\w-]+", " ".join(peers.rosbag for peers in options.values())))
    for line in WITHOUT:
        command, _, option = line.partition(" ")
        told.setdefault(command, set()).add(option)
    for command in ("record", "play", "info", "compress"):
        out = subprocess.run(["rosbag", command, "--help"], stdout=subprocess.PIPE, timeout=60).stdout.decode()
        there = set(re.findall(r"^ +(?:-\w[^,\n]*, )?(--[\w-]+)", out, re.MULTILINE)) - {"--help"}
        extra = {"--bz2", "--lz4", "--quiet"} if command == "compress" else {"--min-space"}
        assert there - told.get(command, set()) <= extra, command
        if command in ("record", "play", "info"):
            assert told[command] <= there | {"--min-space"}, command
