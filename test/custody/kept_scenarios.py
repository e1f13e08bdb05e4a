"""Scenarios that once broke a rule, shortened to what it took; each name says what was wrong.

Unlike seeds they keep their meaning when the generator changes.
"""
from typing import Any, Dict, Tuple

from generator import Event, Scenario


def _scenario(*events: Tuple[float, str, Dict[str, Any]], seed: int = 1, length: float = 8.0, ends: str = "leave",
              settings: Dict[str, Any], **more: Any) -> Scenario:
    return Scenario(seed, length, tuple(Event(*event) for event in events), settings, ends=ends, **more)


_SETTINGS = {"feed_period": 0.03, "motion_timeout": 20.0, "servo_timeout": 2.0}


def _joint_move(joint: int, way: float, speed: float, wait: bool, caller: int = 0) -> Dict[str, Any]:
    delta = tuple(way if index == joint else 0.0 for index in range(6))
    return {"caller": caller, "delta": delta, "speed": speed, "acceleration": 4.0 + 4.0 * speed, "wait": wait}


def _linear_move(shift: Tuple[float, ...], turn: Tuple[float, ...], speed: float, wait: bool, caller: int = 0
                 ) -> Dict[str, Any]:
    return {"caller": caller, "shift": shift, "turn": turn, "speed": speed, "acceleration": 1.0 + 6.0 * speed,
            "wait": wait}


KEPT: Dict[str, Scenario] = {
    "a feed that is faster than asked for was never believed again after a pause": _scenario(
        (1.0, "pause", {"duration": 0.3}), (2.0, "joint_move", _joint_move(0, 0.3, 1.0, True)),
        settings=dict(_SETTINGS, feed_period=0.1), forced_feed_period=0.03),
    "beside a simulated controller a status port that was lost was not connected again": _scenario(
        (2.0, "cut", {"port": "COMMAND", "driver_learns": True, "controller_learns": True}),
        (4.0, "cut", {"port": "STATUS", "driver_learns": True, "controller_learns": True}),
        settings=dict(_SETTINGS, simulator="twin"), identity="twin"),
    "a queued move that began late found nobody in custody": _scenario(
        (1.5, "queue", {"caller": 0, "joint": 0, "ways": (0.1, 0.105), "speed": 1.0, "first_waits": False,
                        "apart": 0.05}),
        (1.52, "late_start", {"delay": 1.5, "duration": 8.0}), settings=_SETTINGS),
    "a queue that comes by its last target was taken for done": _scenario(
        (1.0, "late_start", {"delay": 1.5, "duration": 8.0}),
        (1.5, "queue", {"caller": 0, "joint": 0, "ways": (0.1, 0.3, 0.1), "speed": 2.0, "first_waits": False,
                        "apart": 0.0}), seed=3, settings=_SETTINGS),
    "a move that was stopped at the pendant was completed by the one behind it": _scenario(
        (1.0, "linear_move", _linear_move((0.0, 0.0, 0.0), (0.07, 0.0, 0.0), 0.023, True)),
        (1.085, "pendant_stop", {}),
        (1.31, "linear_move", _linear_move((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.06, False, caller=2)),
        settings=_SETTINGS),
    "a move that never began was completed while the feed did not tell the pose": _scenario(
        (1.0, "late_start", {"delay": 1.5, "duration": 8.0}),
        (1.5, "linear_move", _linear_move((0.02, 0.0, 0.0), (0.0, 0.0, 0.0), 0.04, True)),
        (2.0, "feed_drops", {"fields": ("actual_position",), "duration": 2.0}), seed=8, settings=_SETTINGS),
    "a move was told that it is stopped while every stop was refused": _scenario(
        (1.0, "refuse_stop_for", {"duration": 4.0}), (1.1, "joint_move", _joint_move(5, -3.0, 1.0, True)),
        (1.35, "stop", {"caller": 9}),
        settings=_SETTINGS),
}
