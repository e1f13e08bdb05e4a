"""Durations, sizes and numbers of the command line."""
import argparse

import pytest

from jaka_bag.cli import quantities


@pytest.mark.parametrize("text, seconds", [("5", 5.0), ("0.5", 0.5), (".5s", 0.5), ("250ms", 0.25), ("2m", 120.0),
                                           ("1.5h", 5400.0), ("1e-3", 0.001), ("1:30", 90.0),
                                           ("1:02:03.5", 3723.5), ("0:07", 7.0)])
def test_durations(text, seconds):
    assert quantities.duration(text) == pytest.approx(seconds)


@pytest.mark.parametrize("text, size", [("1000", 1000), ("64k", 65536), ("1.5M", 1572864), ("1G", 1 << 30),
                                        ("10MB", 10 << 20), ("5b", 5)])
def test_sizes(text, size):
    assert quantities.size(text) == size


def test_megabytes_are_the_unit_unless_another_is_given():
    assert quantities.megabytes("3") == 3 << 20
    assert quantities.megabytes("3k") == 3 << 10


@pytest.mark.parametrize("parse, text", [
    (quantities.duration, "soon"), (quantities.duration, "-1"), (quantities.duration, "1d"), (quantities.duration, ""),
    (quantities.duration, "1:75"), (quantities.duration, "1:2:3:4"), (quantities.duration, "1e99"),
    (quantities.time_point, "x"), (quantities.time_point, "nan"), (quantities.time_point, "1e99"),
    (quantities.time_point, ""), (quantities.time_point, "-"), (quantities.time_point, "@"),
    (quantities.positive_ns, "0"),
    (quantities.size, "big"), (quantities.size, "-5"), (quantities.size, "1T"), (quantities.megabytes, "x"),
    (quantities.positive_number, "0"), (quantities.positive_number, "-1"), (quantities.positive_number, "inf"),
    (quantities.positive_number, "nan"), (quantities.positive_number, "x"), (quantities.count, "-1"),
    (quantities.count, "1.5"), (quantities.count, "")])
def test_nonsense_is_refused(parse, text):
    with pytest.raises(argparse.ArgumentTypeError):
        parse(text)


def test_numbers():
    assert quantities.positive_number("2.5") == 2.5
    assert quantities.count("12") == 12


@pytest.mark.parametrize("text, ns, is_absolute", [
    ("12", 12000000000, False), ("-2.5", -2500000000, False), ("1:30", 90000000000, False),
    ("-2m", -120000000000, False),
    ("1700000000.000000001", 1700000000000000001, True), ("1700000000", 1700000000000000000, True),
    ("42.000000000", 42000000000, True), ("(42.500000000)", 42500000000, True), ("@42.5", 42500000000, True)])
def test_moments_are_offsets_or_absolute(text, ns, is_absolute):
    assert quantities.time_point(text) == (ns, is_absolute)
