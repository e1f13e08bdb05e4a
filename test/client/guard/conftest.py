"""Drivers in processes of their own, each with its guard, for the tests of the guard."""
import pytest
from guarded_driver import GuardedDriver


@pytest.fixture
def driver(bench):
    """Return a function that starts a driver with a motion under way: ``driver(motion, **options of the bench)``."""
    started = []

    def start(motion, **options):
        one = bench(**options)
        started.append(GuardedDriver(one, motion))
        return one, started[-1]

    yield start
    for process in started:
        process.kill()
