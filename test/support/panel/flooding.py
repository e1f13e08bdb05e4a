"""Strangers that flood a panel, for a while (``strangers.py``, a process of its own)."""
import contextlib
import subprocess
import sys
import time
from pathlib import Path

SETTLE_S = 0.5


@contextlib.contextmanager
def strangers(panel, count, kind="ping"):
    """Have so many strangers flood a panel, by TLS where it speaks that, with what ``kind`` says."""
    tls = ["tls"] if panel.scheme == "https" else []
    process = subprocess.Popen([sys.executable, str(Path(__file__).with_name("strangers.py")), str(panel.port),
                                str(count), kind, *tls], stdout=subprocess.PIPE)
    try:
        process.stdout.readline()
        time.sleep(SETTLE_S)
        yield
    finally:
        process.kill()
        process.wait()
        process.stdout.close()
