"""Freed memory that a process keeps for its next arrays, where its C library is glibc."""
import ctypes
import subprocess
import sys

import pytest
from import_graph import ROOT

FAULTS = """
import resource, sys
sys.path.insert(0, %r)
import numpy as np
from jaka_bag import allocator
if "keep" in sys.argv:
    allocator.keep_freed_memory()
before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
for _ in range(10):
    some = [np.ones(2 << 20, np.uint8) for _ in range(8)]
    del some
print(resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before)
""" % str(ROOT / "tools")


def faults(*words):
    """Return the page faults of a process that makes eight arrays of 2 MiB at a time, ten times."""
    done = subprocess.run([sys.executable, "-c", FAULTS, *words], env={}, stdout=subprocess.PIPE, text=True,
                          check=True)
    return int(done.stdout)


@pytest.mark.skipif(not hasattr(ctypes.CDLL(None), "mallopt"), reason="another C library")
def test_what_is_freed_is_kept():
    asked_for = 10 * 8 * 2 * 1024 // 4  # pages
    assert faults() > 0.8 * asked_for, "the system's own setting"
    assert faults("keep") < 0.3 * asked_for
