"""The session with the driver of one arm: its feed, its stop, its jog topics, its description, what runs on it."""
import threading
from typing import Any, Dict, List, Optional, Set

from ..authority.jog_hold import JogSpeedLimits, Place
from ..graph import description, motion_lists
from ..graph.arm_feed import STALE_S, ArmFeed
from ..graph.arms import Driver
from ..graph.jog_publishers import JogPublishers
from ..graph.stopper import Stopper

_LINGER_S = 10.0
"""Time, s, for which the 125 Hz topics stay subscribed after the last page has gone."""
_TOLD_S = 0.5
"""Longest time, s, without a state for a page where no joints come: it shows their age."""
_PLOT_S = 0.12
"""Least time, s, between two messages of curves: 8 Hz, at which they seem to flow."""
_LONGEST_PLOT = 100
"""Samples after which one is sent at once: after a stall no single message is long."""


class ArmSession:
    """One arm and the session with its driver, as pages see it.

    Attributes:
        driver: The driver as the master knows it.
        feed: The driver's topics.
        stopper: The driver's stop service.
        jog: The driver's jog topics.
        is_listed: True if the master knows the driver.
        has_simulator: True if the simulated controller's operator port answers.
        cancels: Set to end trajectories that run.
        is_planning: True while a list of motions is planned.
    """

    def __init__(self, driver: Driver, simulator_port: int) -> None:
        """Subscribe and advertise; this waits for the master."""
        self.driver = driver
        self.feed = ArmFeed(driver)
        self.stopper = Stopper(driver.node)
        self.jog = JogPublishers(driver.node)
        self.is_listed = True
        self.has_simulator = False
        self.simulator_port = driver.simulator_port or simulator_port
        self.cancels: Set[threading.Event] = set()
        self.is_planning = False
        self.watched_at = -1e9
        self._description: Optional[description.Description] = None
        self._was_generated = False
        self._count = 0
        self._told_at = -1e9
        self._told_joints_at = -1e9
        self._plot: Optional[Dict[str, Any]] = None
        self._plot_at = -1e9

    # ---- in a thread that may wait ----

    def look(self, driver: Driver, is_watched: bool, now: float) -> None:
        """Update to what the master knows: subscribe as pages watch, and read the description."""
        self.driver = driver
        if is_watched:
            self.watched_at = now
        self.stopper.find()
        self.feed.follow(driver, is_watched or now - self.watched_at < _LINGER_S)
        text = driver.description
        if not text and not self._was_generated:
            self._was_generated = True
            text = description.generated(str(driver.parameter("model", "zu7")), str(driver.parameter("dh_file", "")),
                                         driver.prefix)
        if text and (self._description is None or text != self._description.text):
            self._description = description.Description(text)

    def close(self) -> None:
        """Let go of the driver."""
        self.feed.close()
        self.jog.close()
        self.stopper.close()

    # ---- in the loop ----

    @property
    def description(self) -> Optional[description.Description]:
        """The URDF, where there is one."""
        return self._description

    @property
    def joint_limits(self) -> Optional[List[Dict[str, Any]]]:
        """``name``, ``lower``, ``upper``, ``velocity`` of each joint, rad and rad/s."""
        return None if self._description is None else self._description.joints

    @property
    def limits(self) -> JogSpeedLimits:
        """The limits of the velocity jog."""
        return JogSpeedLimits(**self.driver.jog_limits)

    def place(self, now: float) -> Optional[Place]:
        """Return where the arm is, None if that is not fresh."""
        joints = self.feed.joints
        if joints is None or now - joints.at > STALE_S or not self.is_listed:
            return None
        tool = self.feed.tool(now)
        return Place(tuple(joints.position), None if tool is None or tool["age"] > STALE_S
                     else (tuple(tool["p"]), tuple(tool["r"])))

    def shown(self, now: float) -> Dict[str, Any]:
        """Return the arm as the message ``arms`` has it."""
        driver, about = self.driver, self._description
        return {
            "id": driver.node, "namespace": driver.namespace, "label": driver.node.strip("/"),
            "alive": self.is_listed and self.feed.is_alive(now), "simulated": self.feed.simulated,
            "model": str(driver.parameter("model", "zu7")), "interface": driver.interface,
            "controller": "%s:%d" % (driver.parameter("ip", "127.0.0.1"), driver.parameter("command_port", 10001)),
            "prefix": driver.prefix, "joints": self.joint_limits,
            "frames": {name: driver.prefix + str(driver.parameter(name + "_frame", default)) for name, default in (
                ("base", "base_link"), ("flange", "tool0"), ("tool", "tool"))},
            "has": {"programs": driver.offers("program/play"), "speed": driver.offers("set_speed_slider"),
                    "recover": driver.offers("recover"), "wrench": driver.publishes("wrench"),
                    "trajectory": driver.action is not None, "zero_force": driver.offers("zero_ftsensor"),
                    "path": motion_lists.is_offered(driver)},
            "simulator": self.has_simulator and self.feed.simulated is True, "jog": driver.jog_limits,
            "description": None if about is None else about.fingerprint,
            "zones": self.feed.zones if driver.offers("set_workspace") else None}

    def next_state(self, now: float, is_begin: bool = False) -> Optional[Dict[str, Any]]:
        """Return the message ``state`` if there is anything new in it; ``is_begin``: in any case."""
        joints = self.feed.joints
        sampled_at = -1e9 if joints is None else joints.at
        if not is_begin and sampled_at <= self._told_joints_at and now - self._told_at < _TOLD_S:
            return None
        self._told_at, self._told_joints_at = now, sampled_at
        self._count += 1
        state = {"t": "state", "arm": self.driver.node, "n": self._count, "now": round(now, 4), **self.feed.state(now)}
        state["fresh"] = state["fresh"] and self.is_listed
        return state

    def next_plot(self, now: float) -> Optional[Dict[str, Any]]:
        """Return the message ``plot``, a few times a second; read what has come."""
        new = self.feed.read(now)
        if self._plot is None:
            self._plot = new
        elif new["s"]:
            self._plot["s"] += new["s"]
            for name in ("q", "dq", "e"):
                for column, more in zip(self._plot[name], new[name]):
                    column += more
        count = len(self._plot["s"])
        if not count or (now - self._plot_at < _PLOT_S and count < _LONGEST_PLOT):
            return None
        plot, self._plot, self._plot_at = self._plot, None, now
        return {"t": "plot", "arm": self.driver.node, "now": round(now, 4), **plot}

    def named(self, messages: List[Dict[str, Any]]) -> List[Dict[str, Any]]:
        """Return messages of the feed with the arm's id added."""
        return [{**message, "arm": self.driver.node} for message in messages]

    def is_moving(self, now: float) -> bool:
        """Return whether the arm moves by the driver's last status; True without a fresh one."""
        status = self.feed.state(now)["status"]
        return status is None or status["in_motion"] is not False or status["age"] > STALE_S

    def cancel(self) -> None:
        """End the trajectories that run."""
        for cancelled in self.cancels:
            cancelled.set()

