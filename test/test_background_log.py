import logging
import subprocess
import sys

import pytest
from arm_bench import fill
from import_graph import ROOT
from waiting import WAIT

from jaka_bag.cli import notices
from jaka_ros_driver.background_log import Background, StandardErrorLog, _StandardError

PROGRAM = """
import sys
from jaka_ros_driver.background_log import StandardErrorLog
log = StandardErrorLog("someone")
sys.stdin.readline()
for number in range(100):
    log.write("line %d" % number)
print("goes on", flush=True)
log.close(0.2)
"""


NOTICES = """
import sys
from jaka_bag.cli.notices import Notices
with Notices("someone", False) as notices:
    for number in range(100):
        notices.say("line %d" % number)
print("goes on", flush=True)
"""


def writing(program=PROGRAM):
    return subprocess.Popen([sys.executable, "-c", program], cwd=str(ROOT), stdin=subprocess.PIPE,
                            stdout=subprocess.PIPE, stderr=subprocess.PIPE, universal_newlines=True)


@pytest.mark.parametrize("program", [PROGRAM, NOTICES])
def test_lines_come_whole_and_in_their_order(program):
    out, said = writing(program).communicate("\n", timeout=WAIT)
    assert out == "goes on\n"
    assert said.splitlines() == ["someone: line %d" % number for number in range(100)]


def test_a_full_pipe_holds_up_neither_the_writer_nor_its_end():
    with writing() as program:
        fill(program.stderr)
        program.stdin.write("\n")
        program.stdin.flush()
        assert program.stdout.readline() == "goes on\n"
        assert program.wait(WAIT) == 0


def test_a_reader_that_is_gone_is_no_error():
    with writing() as program:
        program.stderr.close()
        program.stdin.write("\n")
        program.stdin.flush()
        assert program.stdout.readline() == "goes on\n"
        assert program.wait(WAIT) == 0


def test_a_stream_that_is_no_file_is_written_to(capsys):
    log = StandardErrorLog("someone")
    log.write("here")
    log.close()
    assert capsys.readouterr().err == "someone: here\n"


@pytest.mark.parametrize("kind", [_StandardError, notices._StandardError])
def test_the_lock_of_a_handler_is_one_that_can_be_taken(kind):
    with kind().lock:  # as logging.Handler.handle does from Python 3.13 on: nothing is written where there is none
        pass


def test_a_handler_that_writes_nothing_is_told_at_the_end():
    class Broken(logging.Handler):
        """A handler that fails at every record."""

        def emit(self, record):
            raise TypeError("no lock")

    background = Background(Broken())
    assert background.end(WAIT)
    background = Background(Broken())
    background.handle(logging.makeLogRecord({"msg": "why the arm was stopped"}))
    assert not background.end(WAIT)
