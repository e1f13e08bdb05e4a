"""Strangers that flood a panel, for a while (``strangers.py``, a process of its own)."""
import contextlib
import subprocess
import sys
import time
from pathlib import Path

SETTLE_S = 0.5


@contextlib.contextmanager
def strangers(port, count, kind="ping"):
    """Have so many strangers flood the panel with what ``kind`` says."""
    process = subprocess.Popen([sys.executable, str(Path(__file__).with_name("strangers.py")), str(port), str(count),
                                kind], stdout=subprocess.PIPE)
    try:
        process.stdout.readline()
        time.sleep(SETTLE_S)
        yield
    finally:
        process.kill()
        process.wait()
        process.stdout.close()
