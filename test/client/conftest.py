"""Benches of one simulated controller each, and calls in threads; none of them outlives its test."""
import threading

import pytest
from arm_bench import Bench
from waiting import InBackground, eventually


@pytest.fixture
def bench(tmp_path):
    made = []

    def make(**options):
        made.append(Bench(tmp_path, **options))
        return made[-1]

    threads = set(threading.enumerate())
    yield make
    for one in made:
        one.close()
    assert eventually(lambda: set(threading.enumerate()) <= threads), "threads were left behind"


@pytest.fixture
def call():
    return InBackground
