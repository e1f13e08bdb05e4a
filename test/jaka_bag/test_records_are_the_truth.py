"""The answers of the commands about logs whose indexes lie: those of a walk over all records."""
import pytest
from drawn_answers import check
from drawn_logs import draw

LOGS = 120
"""Logs of one run; ``test/soak/soak_drawn_logs.py`` takes thousands."""


def test_equal_times_of_two_chunks_keep_the_order_of_the_file(tmp_path):
    check(draw(220, tmp_path), 220, tmp_path)


@pytest.mark.parametrize("first", range(0, LOGS, 20))
def test_each_command_answers_as_a_walk_over_the_records(tmp_path, first):
    for seed in range(first, first + 20):
        log = draw(seed, tmp_path)
        try:
            check(log, seed, tmp_path)
        except AssertionError as error:
            raise AssertionError("seed %d, %s, lie %s: %s" % (seed, log.path.name, log.lie, error)) from error
