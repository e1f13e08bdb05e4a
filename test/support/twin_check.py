"""The truth of the stated error of a twin: the arm's own motion beside that of the simulated arm of its report."""
from jaka_ros_driver.probe import report
from jaka_ros_driver.probe.fit import times_of
from jaka_ros_driver.probe.move import ASKED
from jaka_ros_driver.probe.recorded import quantile
from jaka_ros_driver.probe.twin import BACK, place_at, twin_motion
from jaka_ros_driver.simulation.dialect.table import Dialect

WAY = 2.5
"""The way of the motion that is compared, deg."""


def way_back(dialect):
    """Return that motion of the simulated arm of this dialect: s, deg."""
    return twin_motion(dialect, "zu7", None, WAY, ASKED[BACK], None)


def missed(motion, found, firmware="1.7.2"):
    """Return in what the twin of these facts is further from an arm's motion than they state; no feed lies between."""
    made = way_back(Dialect.default(firmware).replaced(report.dialect_of(found)))
    true = [(at, place) for at, place in motion if 0.005 * WAY < place < 0.995 * WAY]
    degrees = quantile([abs(place - place_at(made, at)) for at, place in true], 0.95)
    middle = [(at, place) for at, place in true if 0.1 * WAY < place < 0.9 * WAY]
    passed = times_of(lambda at: place_at(made, at), made[-1][0], WAY, [place for _, place in middle])
    seconds = quantile([abs(at - when) for (at, _), (when, _) in zip(middle, passed)], 0.95)
    return [words for words, is_worse in (("%.3f deg" % degrees, degrees > found["twin_angle"].value),
                                          ("%.3f s" % seconds, seconds > found["twin_time"].value)) if is_worse]
