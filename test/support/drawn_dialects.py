"""Dialects of the controller for live tests: drawn by number, with an arm that begins to move when it is asked to."""
import json
from pathlib import Path

from jaka_ros_driver.simulation.dialect.table import Dialect

FIRMWARE = "1.7.1"


def dialect_options(number, folder, **fixed):
    """Return the simulated controller's options for this dialect, and the points in which it differs, in words.

    An arm that begins seconds after the acceptance is stopped before it moves, so that nothing could be cut short;
    that is for the custody simulation. Moves accelerate as they ask for, so that they last as long.
    ``fixed`` are more points that are not drawn.
    """
    drawn = dict(Dialect.from_seed(number, FIRMWARE).as_dict(), start_delay=0.0, move_acceleration=1.0, **fixed)
    usual = Dialect.default(FIRMWARE).as_dict()
    path = Path(folder) / ("dialect-%d.json" % number)
    path.write_text(json.dumps(drawn), encoding="utf-8")
    text = ", ".join("%s %s" % (name, value) for name, value in sorted(drawn.items()) if value != usual[name])
    return ("--firmware", FIRMWARE, "--dialect", str(path)), "dialect %d: %s" % (number, text)
