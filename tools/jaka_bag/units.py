"""Units of times and lengths, one name for each factor."""

NS_PER_S = 1000000000
"""Nanoseconds in a second, int."""


def s_to_ms(value: float) -> float:
    """Convert a time from s to ms."""
    return value * 1000.0


def ms_to_s(value: float) -> float:
    """Convert a time from ms to s."""
    return value / 1000.0


def m_to_mm(value: float) -> float:
    """Convert a length from m to mm."""
    return value * 1000.0


def mm_to_m(value: float) -> float:
    """Convert a length from mm to m."""
    return value / 1000.0
