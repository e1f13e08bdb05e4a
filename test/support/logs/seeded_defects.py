"""The defects that a comparison must find, each with the check that must find it."""
from typing import Callable, Dict, NamedTuple

import numpy as np
from synthetic_session import Call, Conditions, Session, simulate

from jaka_bag.compare.verdict import Aspect
from jaka_ros_driver.kinematics.rotations import rpy_from_rotation_vector


class Defect(NamedTuple):
    """A candidate's defect, and the checks that fail because of it, the right one first."""

    seed: Callable[[Session], object]
    found_by: Aspect
    field: str = ""
    conditions: Conditions = Conditions(seed=11, start_s=1.7)


def _offset(session: Session) -> None:
    session.position[:, 2] += 0.001


def _swap(session: Session) -> None:
    session.joints[:, [1, 2]] = session.joints[:, [2, 1]]


def _rpy(session: Session) -> None:
    session.rotation_vector = np.array([rpy_from_rotation_vector(v)
                                        for v in session.rotation_vector])


def _states_at(rate_hz: int) -> Callable[[Session], object]:
    def seed(session: Session) -> None:
        number = np.arange(len(session.time))
        session.keep["robot_states"] = np.floor(number * rate_hz / 125) != np.floor((number - 1) * rate_hz / 125)
    return seed


def _bursts(session: Session) -> None:
    time = session.log_time["robot_states"]
    session.log_time["robot_states"] = time[np.minimum(np.arange(len(time)) // 13 * 13 + 12, len(time) - 1)]


def _stale_stamps(session: Session) -> None:
    session.stamp = session.stamp - 0.4


def _frozen_stamps(session: Session) -> None:
    session.stamp = session.stamp[np.arange(len(session.stamp)) // 4 * 4]


def _restamped(session: Session) -> None:
    old = np.arange(len(session.time)) // 60 * 60
    session.joints = session.joints[old]


def _missed_state(session: Session) -> None:
    changes = np.flatnonzero(np.diff(session.states[:, 0])) + 1
    session.states[changes[2]:changes[3], 0] = 0


def _lost_reply(session: Session) -> None:
    lost: Call = session.calls[2]
    session.calls[2] = lost._replace(success=False, response="", error="the controller did not answer")


def _millimetres(session: Session) -> None:
    session.position = session.position * 1000.0


def _nothing(session: Session) -> None:
    """Change nothing: the defect is in the conditions."""


DEFECTS: Dict[str, Defect] = {
    "2 % slower": Defect(_nothing, Aspect.PACE, "all motions", Conditions(seed=11, start_s=1.7, pace=1.02)),
    "1 mm offset": Defect(_offset, Aspect.POSITION),
    "two joints swapped": Defect(_swap, Aspect.JOINTS, "joint_2"),
    "RPY for rotation vector": Defect(_rpy, Aspect.ORIENTATION),
    "state topic at 60 Hz": Defect(_states_at(60), Aspect.RATES),
    "state topic at 90 Hz": Defect(_states_at(90), Aspect.RATES),
    "state topic in bursts of 0.1 s": Defect(_bursts, Aspect.JITTER),
    "stale stamps": Defect(_stale_stamps, Aspect.STAMPS, "latency"),
    "stamps that stand still": Defect(_frozen_stamps, Aspect.STAMPS, "repeated"),
    "old samples stamped as new": Defect(_restamped, Aspect.JOINTS, "joint_1"),
    "a missed state": Defect(_missed_state, Aspect.STATES, "motion_state"),
    "a lost service reply": Defect(_lost_reply, Aspect.CALLS),
    "jog not stopped at 3 s": Defect(_nothing, Aspect.STATES, "motion_state timing",
                                     Conditions(seed=11, start_s=1.7, jog_extra_s=1.0)),
    "mm for m": Defect(_millimetres, Aspect.POSITION),
}


def defective(program, defect: Defect) -> Session:
    """Return a run of the program that has the defect."""
    session = simulate(program, defect.conditions)
    defect.seed(session)
    return session
