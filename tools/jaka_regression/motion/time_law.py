"""The speed along a path: as recorded, times a factor, and slower where the arm could not follow.

With toppra only the stretches that are too fast are slowed down; with ruckig alone the whole way is, to what its
fastest moment needs. The path itself is the same with both.
"""
import importlib
import logging
import math
from typing import Any, NamedTuple, Optional

import numpy as np

from jaka_bag.errors import BagError, MissingDependency
from jaka_bag.messages.batch import Array

from .limits import ArmLimits
from .path import REST_S, SmoothPath

TICK_S = 0.004
"""Step at which the rate is given, s."""
SOLVERS = ("toppra", "ruckig")
_RATE_CHANGE_S = 0.125
"""Time in which the rate goes from nothing to the whole, s."""
_GRID_STEPS = 2
"""Steps of the path in one of the solver's grid: a coarser one is solved faster, and what changes within costs share of
the limits."""
_SOFTENING = 12
"""Ticks, on both sides, over which a change of the rate is spread."""


class TimeLaw(NamedTuple):
    """The place of the arm on its path, at even times.

    Attributes:
        place: Recorded time, s (n,), from 0 to the whole.
        rate: Recorded seconds for each second (n,).
        change: Change of the rate, 1/s (n,).
    """

    place: Array
    rate: Array
    change: Array


def rest_for(factor: float) -> float:
    """Return the standstill, recorded s, that the ends of a path need for this factor of the recorded speed."""
    return REST_S * max(1.0, factor)


def find_solver(name: Optional[str] = None) -> str:
    """Return the package that is used: the named one, else the first of ``SOLVERS`` that is installed.

    Raises:
        MissingDependency: It is not installed, or none is.
    """
    for solver in SOLVERS if name is None else (name,):
        try:
            importlib.import_module(solver)
        except ImportError:
            continue
        return solver
    raise MissingDependency("replay-motion needs the Python package toppra, or ruckig, to keep the motion within the "
                            "arm's limits: pip install toppra" if name is None else
                            "the Python package %s is not installed" % name)


def time_law(path: SmoothPath, limits: ArmLimits, factor: float, solver: str) -> TimeLaw:
    """Compute the law that comes nearest to the recorded speed times a factor, within the limits.

    Args:
        path: The smooth path.
        limits: Speeds and accelerations that are not exceeded, but for what the sampling of the path hides.
        factor: Factor of the recorded speed.
        solver: One of ``SOLVERS``.

    Raises:
        BagError: The solver finds none.
    """
    rates = {"toppra": _rates_by_toppra, "ruckig": _rates_by_ruckig}[solver](path, limits, factor)
    window = np.bartlett(2 * _SOFTENING + 1)[1:-1]
    soft = np.convolve(np.pad(rates, _SOFTENING), window / window.sum(), mode="full")
    place = np.concatenate(([0.0], np.cumsum(0.5 * (soft[1:] + soft[:-1])))) * TICK_S
    share = path.duration / place[-1]  # sampling loses a little of the way
    return TimeLaw(place * share, soft * share, np.gradient(soft * share, TICK_S))


def _rates_by_toppra(path: SmoothPath, limits: ArmLimits, factor: float) -> Array:
    """Solve by toppra: the recorded time is one joint more, whose speed is at most the factor."""
    toppra: Any = importlib.import_module("toppra")
    constraint: Any = importlib.import_module("toppra.constraint")
    algorithm: Any = importlib.import_module("toppra.algorithm")
    interpolator: Any = importlib.import_module("toppra.interpolator")
    logging.getLogger(toppra.__name__).setLevel(logging.CRITICAL)  # what goes wrong is raised here
    duration, joints = path.duration, path.position.shape[1]

    class WithTime(interpolator.AbstractGeometricPath):  # type: ignore[misc]
        """The joints, and the recorded time."""

        dof = joints + 1
        path_interval = np.array([0.0, duration])
        waypoints = None

        def __call__(self, places: Any, order: int = 0) -> Array:
            at = np.atleast_1d(np.asarray(places, float))
            time = (at, np.ones(len(at)), np.zeros(len(at)))[order]
            values = np.hstack((path.at(at)[order], time[:, None]))
            return values if np.ndim(places) else values[0]

    speed = np.append(limits.speed, factor)
    acceleration = np.append(limits.acceleration, factor / _RATE_CHANGE_S)
    count = max(2, int(math.ceil(duration / (_GRID_STEPS * path.step))))
    grid = np.linspace(0.0, duration, count + 1)
    solved = algorithm.TOPPRA(
        [constraint.JointVelocityConstraint(np.stack((-speed, speed), axis=1)),
         constraint.JointAccelerationConstraint(np.stack((-acceleration, acceleration), axis=1))],
        WithTime(), gridpoints=grid, solver_wrapper="seidel").compute_parameterization(0.0, 0.0)
    rates = solved[1]
    if rates is None or not np.isfinite(rates).all():
        raise BagError("toppra finds no way to keep the arm within its limits on this path")
    middle = np.maximum(0.5 * (rates[1:] + rates[:-1]), 1e-9)
    times = np.concatenate(([0.0], np.cumsum(np.diff(grid) / middle)))
    ticks = np.arange(0.0, times[-1], TICK_S)
    return np.interp(ticks, times, rates)


def _rates_by_ruckig(path: SmoothPath, limits: ArmLimits, factor: float) -> Array:
    """Solve by ruckig: one rate for the whole path, built up and taken away with limited acceleration and jerk."""
    ruckig: Any = importlib.import_module("ruckig")
    rate = min(factor, float((limits.speed / np.maximum(np.abs(path.velocity).max(axis=0), 1e-9)).min()),
               math.sqrt(float((limits.acceleration / np.maximum(np.abs(path.acceleration).max(axis=0), 1e-9)).min())))
    plan, law = ruckig.InputParameter(1), ruckig.Trajectory(1)
    plan.current_position, plan.target_position = [0.0], [path.duration]
    plan.max_velocity, plan.max_acceleration = [rate], [2.0 * rate / _RATE_CHANGE_S]
    plan.max_jerk = [8.0 * rate / _RATE_CHANGE_S ** 2]
    ruckig.Ruckig(1).calculate(plan, law)
    ticks = np.arange(0.0, law.duration, TICK_S)
    return np.array([law.at_time(tick)[1][0] for tick in ticks.tolist()])
