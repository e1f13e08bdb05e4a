import argparse
import os
import pty
import shutil
import subprocess
import sys

import pytest
from command_places import command_of
from log_samples import read, state_log, write

from jaka_bag.cli.completion import options_by_command
from jaka_bag.cli.main import COMMANDS, load_command, main
from jaka_bag.cli.options import Progress
from jaka_bag.containers.registry import read_index

WITHOUT_ROS = [name for name in COMMANDS if name not in ("record", "play")]


def test_help_tells_every_command(capsys):
    assert main(["--help"]) == 0
    out = capsys.readouterr().out
    assert all("\n  %s" % name in out for name in COMMANDS)
    assert all(len(line) <= 100 for line in out.splitlines())
    assert main([]) == 2


@pytest.mark.parametrize("name", WITHOUT_ROS)
def test_every_command_has_help_and_a_clean_usage_error(name, capsys):
    assert main([name, "--help"]) == 0
    assert capsys.readouterr().out.startswith("usage: jaka_bag %s" % name)
    assert main([name, "--no-such-option"]) == 2
    assert "Traceback" not in capsys.readouterr().err


def test_commands_of_a_package_that_is_not_installed_say_how_to_get_it(capsys, monkeypatch):
    class Nowhere:
        """An importer that raises for the package what Python raises where it is not installed."""

        @staticmethod
        def find_spec(name, path=None, target=None):
            if name == "jaka_regression":
                raise ModuleNotFoundError("No module named %r" % name, name=name)

    for name in [name for name in sys.modules if name.split(".")[0] == "jaka_regression"]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setattr(sys, "meta_path", [Nowhere, *sys.meta_path])
    for name in sorted(COMMANDS):
        if COMMANDS[name].module.startswith("jaka_regression."):
            assert main([name, "--help"]) == 2
            said = capsys.readouterr().err
            assert said.startswith("jaka_bag: error: %s needs the Python package jaka_regression" % name)
            assert "jaka_ros_driver" in said and said.count("\n") == 1


def test_a_misspelt_command_is_guessed(capsys):
    assert main(["covnert"]) == 2
    assert "did you mean 'convert'" in capsys.readouterr().err


@pytest.mark.parametrize("words", [
    ["info", "{missing}"], ["info", "{folder}"], ["info", "{text}"], ["convert", "{missing}", "-o", "{out}.mcap"],
    ["convert", "{text}", "-o", "{out}.mcap"], ["convert", "{log}", "-o", "{log}"], ["convert", "{log}"],
    ["convert", "{log}", "-o", "{out}.txt"], ["convert", "{log}", "-o", "{out}.mcap", "-c", "bz2"],
    ["convert", "{log}", "-o", "{folder}/none/x.mcap"], ["convert", "{log}", "-o", "{out}.mcap", "-e", "("],
    ["filter", "{missing}", "-o", "{out}.bag"], ["merge", "{log}", "{missing}", "-o", "{out}.bag"],
    ["split", "{missing}", "--count", "1"], ["recover", "{missing}"], ["recover", "{text}", "{out}.bag"],
    ["recover", "{log}", "{log}", "--force"], ["export", "{missing}", "-o", "{out}.csv"],
    ["plot", "{missing}"], ["plot", "{text}", "-o", "{out}.svg"]], ids=" ".join)
def test_what_fails_says_so_in_one_line_and_leaves_nothing(tmp_path, words, capsys):
    write(tmp_path / "log.bag", state_log(0.1))
    (tmp_path / "log.mcap").write_bytes(b"precious")
    (tmp_path / "text.bag").write_text("hello")
    before = {name: (tmp_path / name).read_bytes() for name in os.listdir(str(tmp_path))}
    places = {"missing": tmp_path / "missing.bag", "folder": tmp_path, "text": tmp_path / "text.bag",
              "log": tmp_path / "log.bag", "out": tmp_path / "out"}
    assert main([word.format(**places) for word in words]) == 1
    out, err = capsys.readouterr()
    assert err.startswith("jaka_bag: error: ") and err.count("\n") == 1 and not out
    assert {name: (tmp_path / name).read_bytes() for name in os.listdir(str(tmp_path))} == before


def test_a_reader_that_goes_away_is_no_failure_to_talk_about(tmp_path, root):
    path = write(tmp_path / "log.bag", state_log(0.1))
    done = subprocess.run("%s info %s | true" % (" ".join(command_of("jaka_bag")), path), shell=True,
                          cwd=str(root), stderr=subprocess.PIPE)
    assert b"Traceback" not in done.stderr and b"BrokenPipe" not in done.stderr


@pytest.mark.parametrize("name", WITHOUT_ROS)
def test_option_words_do_not_clash(name):
    parser = argparse.ArgumentParser()
    load_command(name).add_arguments(parser)
    assert parser.format_help()


def test_bash_completes_commands_and_options(tmp_path, capsys):
    options = options_by_command()
    assert "--profile" in options["convert"] and set(options) == set(COMMANDS)
    assert main(["completion", "bash"]) == 0
    (tmp_path / "completion").write_text(capsys.readouterr().out)
    script = ('source %s/completion; '
              'COMP_WORDS=(jaka_bag %%s); COMP_CWORD=%%d; _jaka_bag; echo "${COMPREPLY[@]}"' % tmp_path)

    def complete(words, number):
        return subprocess.check_output(["bash", "-c", script % (words, number)]).decode().split()

    assert complete("rec", 1) == ["record", "recover"]
    assert complete("convert --pro", 2) == ["--profile"]
    assert complete("completion z", 2) == ["zsh"]
    assert complete("filter -c l", 3) == ["lz4"] and complete("convert --profile ''", 3) == ["ros1", "ros2"]


def test_zsh_gets_a_script(capsys):
    assert main(["completion", "zsh"]) == 0
    out = capsys.readouterr().out
    assert out.startswith("#compdef jaka_bag") and "'convert:" in out
    zsh = shutil.which("zsh")
    if zsh:
        assert subprocess.run([zsh, "-n"], input=out.encode()).returncode == 0


def test_a_terminal_sees_a_bar_and_quiet_sees_none(tmp_path, root):
    path = write(tmp_path / "log.bag", state_log(0.5))
    code = ("import sys\nfrom jaka_bag.cli import options\noptions._PROGRESS_S = 0.0\n"
            "from jaka_bag.cli.main import main\nsys.exit(main(sys.argv[1:]))")

    def on_terminal(*words):
        master, slave = pty.openpty()
        process = subprocess.Popen([sys.executable, "-c", code, "convert", str(path), *words], cwd=str(root),
                                   stderr=slave, stdout=subprocess.DEVNULL)
        os.close(slave)
        seen = b""
        while True:
            try:
                part = os.read(master, 4096)
            except OSError:
                break
            if not part:
                break
            seen += part
        os.close(master)
        assert process.wait() == 0
        return seen.decode()

    bar = on_terminal("-o", str(tmp_path / "a.mcap"))
    assert "MB/s" in bar and "msg/s" in bar and "left" in bar and "%" in bar
    assert on_terminal("-o", str(tmp_path / "b.mcap"), "-q") == ""


def test_a_silent_progress_does_nothing():
    with Progress(100, "x", None) as progress:
        progress(50, 1)


def test_the_options_and_forms_that_users_of_rosbag_know(tmp_path, capsys):
    log = write(tmp_path / "log.bag", state_log(0.5))
    for option, codec in (("--lz4", "lz4"), ("-j", "bz2")):
        for command in ("convert", "filter", "recover"):
            out = tmp_path / ("%s_%s.bag" % (command, codec))
            assert main([command, str(log), str(out), option, "-q"]) == 0
            assert [entry[0] for entry in read_index(out).codecs] == [codec]
    assert main(["merge", str(log), str(tmp_path / "merged.mcap"), "-q"]) == 0
    assert read(tmp_path / "merged.mcap") == read(log)
    before = log.read_bytes()
    assert main(["merge", str(tmp_path / "merged.mcap"), str(log), "-f"]) == 2
    assert "an output is needed: -o DST, or a last name that no file has yet" in capsys.readouterr().err
    assert log.read_bytes() == before
    assert main(["filter", str(log), str(tmp_path / "f.bag"), "topic == '/model'"]) == 2
    assert "there are no expressions as rosbag's" in capsys.readouterr().err
    assert main(["filter", str(log), str(tmp_path / "f.bag"), "topic == '/model' or topic == \"/b\""]) == 2
    assert "here: -t /model /b" in capsys.readouterr().err
