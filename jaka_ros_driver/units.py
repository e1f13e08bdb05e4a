"""Conversion of millimetres, degrees and milliseconds to SI units and back; the only module with the factors."""
import math
from typing import Iterable, Tuple

NS_PER_S = 1000000000
_MM_PER_M = 1000.0
_DEG_PER_RAD = 180.0 / math.pi


def mm_to_m(value: float) -> float:
    """Convert a length from mm to m; also mm/s to m/s, mm/s2 to m/s2."""
    return value / _MM_PER_M


def m_to_mm(value: float) -> float:
    """Convert a length from m to mm; also m/s to mm/s, m/s2 to mm/s2."""
    return value * _MM_PER_M


def deg_to_rad(value: float) -> float:
    """Convert an angle from deg to rad; also rates and accelerations."""
    return value / _DEG_PER_RAD


def rad_to_deg(value: float) -> float:
    """Convert an angle from rad to deg; also rates and accelerations."""
    return value * _DEG_PER_RAD


def all_mm_to_m(values: Iterable[float]) -> Tuple[float, ...]:
    """Convert each value from mm to m."""
    return tuple([v / _MM_PER_M for v in values])


def all_m_to_mm(values: Iterable[float]) -> Tuple[float, ...]:
    """Convert each value from m to mm."""
    return tuple([v * _MM_PER_M for v in values])


def all_deg_to_rad(values: Iterable[float]) -> Tuple[float, ...]:
    """Convert each value from deg to rad."""
    return tuple([v / _DEG_PER_RAD for v in values])


def all_rad_to_deg(values: Iterable[float]) -> Tuple[float, ...]:
    """Convert each value from rad to deg."""
    return tuple([v * _DEG_PER_RAD for v in values])


def ms_to_s(value: float) -> float:
    """Convert a time from ms to s."""
    return value / 1000.0


def s_to_ms(value: float) -> float:
    """Convert a time from s to ms."""
    return value * 1000.0
