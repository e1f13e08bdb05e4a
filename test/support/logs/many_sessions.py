"""Short runs of made-up cells, an hour apart, one of whose joints may drift."""
import numpy as np
from synthetic_session import Conditions, Step, simulate

SHORT = [Step(0.2, (0.5, 1.2, -1.2, 1.4, 1.3, 0.6))]
HOUR_S = 3600.0


def at(session, seconds):
    """Return the same session recorded so much later, s."""
    session.stamp = session.stamp + seconds
    session.log_time = {name: times + seconds for name, times in session.log_time.items()}
    session.calls = [call._replace(start=call.start + seconds) for call in session.calls]
    return session


def run_of(number, change=None, program=None):
    """Return one of many runs, an hour after the one before."""
    session = simulate(program or SHORT, Conditions(seed=1000 + number, start_s=0.5 + 0.01 * (number % 7)))
    if change is not None:
        change(session)
    return at(session, HOUR_S * number)


def drift(joint, size):
    """Return a change of a session: a joint that is off by so much, rad, at rest after the motion, and by a part of
    that in it."""
    def change(session):
        moved = np.clip((session.time - 1.0) / 1.0, 0.0, 1.0)
        session.joints[:, joint] += size * moved
    return change
