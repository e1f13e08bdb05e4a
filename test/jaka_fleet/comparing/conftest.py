"""A golden log, and one of short runs."""
import pytest
from many_sessions import SHORT
from synthetic_session import Step, moves, simulate, write_log


@pytest.fixture(scope="session")
def program():
    return [*moves(2), Step(0.5, jog_rad_s=0.25, jog_s=1.5)]


@pytest.fixture(scope="session")
def short_golden(tmp_path_factory):
    """Return the path of the golden log of short runs."""
    return write_log(tmp_path_factory.mktemp("short_golden") / "golden.mcap", simulate(SHORT))
