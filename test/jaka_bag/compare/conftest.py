"""A golden log of a made-up arm, and candidates of it."""
import pytest
from synthetic_session import Step, moves, simulate, write_log

PROGRAM = [*moves(5), Step(0.5, jog_rad_s=0.25, jog_s=3.0), *moves(2, seed=9)]


@pytest.fixture(scope="session")
def program():
    return PROGRAM


@pytest.fixture(scope="session")
def golden(tmp_path_factory):
    """Return the path of the golden log."""
    return write_log(tmp_path_factory.mktemp("golden") / "golden.mcap", simulate(PROGRAM))
