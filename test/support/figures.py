"""Figures of measurements: percentiles, and the host's load with the share that a virtual machine's host takes away."""
import os
import time
from pathlib import Path


def _processor_ticks():
    """Return (stolen by the host, all) in clock ticks of all processors since the start; proc(5)."""
    fields = [int(field) for field in Path("/proc/stat").read_text().split("\n", 1)[0].split()[1:9]]
    return fields[7], sum(fields)


class HostLoad:
    """The load from its making until it is asked for."""

    def __init__(self):
        self._began = _processor_ticks()

    def stolen_percent(self):
        """Return the share of the processors' time that the host gave to others while something here wanted to run."""
        stolen, total = (now - then for now, then in zip(_processor_ticks(), self._began))
        return 100.0 * stolen / max(1, total)

    def __str__(self):
        return "load average %s, %.1f %% of the processors' time stolen by the host" % (
            " ".join("%.2f" % load for load in os.getloadavg()), self.stolen_percent())


def best_s(function, arguments, rounds=5):
    """Return the best round's mean cost of one call, s."""
    best = float("inf")
    for _ in range(rounds):
        started = time.perf_counter()
        for argument in arguments:
            function(*argument)
        best = min(best, time.perf_counter() - started)
    return best / len(arguments)


def percentile(values, share):
    """Return the value below which that share of them lies."""
    ordered = sorted(values)
    return ordered[min(len(ordered) - 1, int(share * len(ordered)))]


def summary(seconds):
    """Format median, 95th percentile and largest of durations in s, in ms."""
    return "n %3d  p50 %7.1f ms  p95 %7.1f ms  max %7.1f ms" % (
        len(seconds), 1e3 * percentile(seconds, 0.5), 1e3 * percentile(seconds, 0.95), 1e3 * max(seconds))
