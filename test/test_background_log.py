import subprocess
import sys

from arm_bench import WAIT, fill
from import_graph import ROOT

from jaka_ros_driver.background_log import StandardErrorLog

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


def writing():
    return subprocess.Popen([sys.executable, "-c", PROGRAM], cwd=str(ROOT), stdin=subprocess.PIPE,
                            stdout=subprocess.PIPE, stderr=subprocess.PIPE, universal_newlines=True)


def test_lines_come_whole_and_in_their_order():
    out, said = writing().communicate("\n", timeout=WAIT)
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
