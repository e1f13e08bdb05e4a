"""The settings of the client that a user may change."""
from dataclasses import dataclass
from typing import Optional

from jaka_ros_driver.clearance.workspace import NO_ZONES, Workspace
from jaka_ros_driver.kinematics.limits import SERVO_PERIOD_S
from jaka_ros_driver.protocol.ports import PORT_NUMBERS


@dataclass(frozen=True)
class ClientSettings:
    """Addresses and time limits, s unless the name says otherwise.

    Attributes:
        host: Address of the controller.
        command_port: Its request and reply port (docs/controller-protocol.md section 1).
        status_port: Its status feed.
        connect_timeout: Longest wait for a connection.
        reply_timeout: Longest wait for a reply; when it has passed, the connection is closed and made again.
        silence_timeout: The status feed counts as lost after this time without a byte.
        stale_after: A status sample that is older than this is not used.
        feed_period: Period asked of the status feed.
        motion_timeout: A motion that takes longer is stopped.
        power_timeout: Longest wait for the drives to energise or de-energise.
        enable_timeout: Longest wait for the brakes to open or close.
        jog_timeout: A jog stops this time after the last jog call (docs/interface.md section 1.1).
        servo_timeout: Servo mode is left this time after the last servo target.
        servo_ahead: A servo target is refused unless the arm can reach it within this time, so that the motion ends
            soon after the client stops sending.
        servo_max_joint_jump: Largest distance of a servo target from the frame sent last, rad.
        servo_max_linear_jump: The same for the position of a Cartesian target, m.
        servo_max_angular_jump: The same for its orientation, rad.
        stream_ahead: Number of cycles of 8 ms by which frames of trajectories and velocity jogs are sent ahead.
        trajectory_start_tolerance: Largest distance of an arm at rest from where its trajectory begins, rad.
        late_stamp: A trajectory that was to begin up to this time ago is followed as a whole by an arm that is still at
            its first point.
        trajectory_overshoot: "scale": a trajectory that passes a limit by less than a quarter is slowed there;
            "refuse": it is refused.
        jog_max_joint_speed: Highest speed of a joint in a velocity jog by joints, rad/s.
        jog_max_linear_speed: Highest speed of the tool in a velocity jog, m/s.
        jog_max_angular_speed: Highest speed of the tool's turning in a velocity jog, rad/s.
        link_loss_stop: The controller is asked to stop the arm this time after it has lost this client during a motion;
            0 where it is not asked.
        start_delay: Time from the acceptance of a move or jog to its beginning, where that is known of
            this controller.
        io_index_base: Index on the wire of the first input or output, 0 or 1; None where the controller's version tells
            (docs/controller-protocol.md section 13).
        takes_io_as_counted: True where the controller's own count of the terminals stands, as with the maker's driver:
            an output that is set may be seen at either place that its index on the wire can mean. False: it must be
            seen at its own place in the status frame.
        guard_motion: "stop": a motion that would come too near to the arm itself, to a zone, or to an end of what the
            arm can do is refused, or braked; "warn": it is logged; "off": nobody looks.
        workspace: The zones around the arm, and the shape of its tool.
        simulator: Identity of the simulated controller that was launched with this driver; with it, no other controller
            is used. Empty for any controller.
    """

    host: str
    command_port: int = PORT_NUMBERS["command"]
    status_port: int = PORT_NUMBERS["status"]
    connect_timeout: float = 1.0
    reply_timeout: float = 0.9
    silence_timeout: float = 0.8
    stale_after: float = 0.5
    feed_period: float = 0.008
    motion_timeout: float = 300.0
    power_timeout: float = 30.0
    enable_timeout: float = 30.0
    jog_timeout: float = 3.0
    servo_timeout: float = 10.0
    servo_ahead: float = 0.2
    servo_max_joint_jump: float = 0.1
    servo_max_linear_jump: float = 0.05
    servo_max_angular_jump: float = 0.1
    stream_ahead: int = 0
    trajectory_start_tolerance: float = 0.01
    late_stamp: float = 1.0
    trajectory_overshoot: str = "scale"
    jog_max_joint_speed: float = 0.5
    jog_max_linear_speed: float = 0.25
    jog_max_angular_speed: float = 0.5
    link_loss_stop: float = 0.3
    start_delay: float = 0.0
    io_index_base: Optional[int] = None
    takes_io_as_counted: bool = False
    guard_motion: str = "stop"
    workspace: Workspace = NO_ZONES
    simulator: str = ""

    @property
    def stream_lead(self) -> float:
        """The time by which those frames are sent ahead, s."""
        return self.stream_ahead * SERVO_PERIOD_S
