"""Libraries of requirements-oracle.txt, which share nothing with what they judge."""
import importlib.util
import sys
from pathlib import Path

import import_graph
import pytest

IS_SET_UP = Path(sys.prefix) == import_graph.ROOT / "build" / "venv"
"""True in the environment of tools/dev setup, which .ci/run uses: there a library that is missing is a failure."""


def are_there(module):
    """Return whether tests with this module run; else they are left out."""
    return IS_SET_UP or importlib.util.find_spec(module) is not None


def imported(module):
    """Return the module; where it may be missing and is, skip the test file that asks."""
    return importlib.import_module(module) if IS_SET_UP else pytest.importorskip(
        module, reason="%s of requirements-oracle.txt is not installed" % module)
