"""The early end of the long runs over logs: what was walked is said, and nothing is called a finding."""
import os
import re
import signal
import subprocess
import sys

import pytest
from import_graph import ROOT

SOAK = ROOT / "test" / "soak"
RUNS = {"soak_drawn_logs.py": ("--logs", "1000000"), "soak_fuzz_logs.py": ("60", "1")}


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
@pytest.mark.parametrize("name", sorted(RUNS))
def test_a_run_that_is_ended_early_says_so(tmp_path, name, number):
    with subprocess.Popen([sys.executable, str(SOAK / name), *RUNS[name]], cwd=str(tmp_path), stdout=subprocess.PIPE,
                          stderr=subprocess.STDOUT, start_new_session=True, encoding="utf-8") as process:
        try:
            first = process.stdout.readline()
            os.killpg(process.pid, number)  # as a terminal and a system's end do it: processes of commands get it, too
            told = process.communicate(timeout=120)[0]
        finally:
            process.kill()
    assert "seed" in first
    assert process.returncode == 128 + number, told
    assert re.search(r"^ended early by %s: \d+ " % signal.Signals(number).name, told, re.MULTILINE), told
    assert "Traceback" not in told and not (tmp_path / "fuzzed").exists(), told
