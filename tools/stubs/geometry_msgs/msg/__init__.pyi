# Made by test/support/pages/message_stubs.py.
import genpy
import std_msgs.msg

class Point(genpy.Message):
    x: float
    y: float
    z: float
    def __init__(
        self,
        x: float = ...,
        y: float = ...,
        z: float = ...,
    ) -> None: ...

class Pose(genpy.Message):
    position: Point
    orientation: Quaternion
    def __init__(
        self,
        position: Point = ...,
        orientation: Quaternion = ...,
    ) -> None: ...

class PoseStamped(genpy.Message):
    header: std_msgs.msg.Header
    pose: Pose
    def __init__(
        self,
        header: std_msgs.msg.Header = ...,
        pose: Pose = ...,
    ) -> None: ...

class Quaternion(genpy.Message):
    x: float
    y: float
    z: float
    w: float
    def __init__(
        self,
        x: float = ...,
        y: float = ...,
        z: float = ...,
        w: float = ...,
    ) -> None: ...

class Transform(genpy.Message):
    translation: Vector3
    rotation: Quaternion
    def __init__(
        self,
        translation: Vector3 = ...,
        rotation: Quaternion = ...,
    ) -> None: ...

class TransformStamped(genpy.Message):
    header: std_msgs.msg.Header
    child_frame_id: str
    transform: Transform
    def __init__(
        self,
        header: std_msgs.msg.Header = ...,
        child_frame_id: str = ...,
        transform: Transform = ...,
    ) -> None: ...

class Twist(genpy.Message):
    linear: Vector3
    angular: Vector3
    def __init__(
        self,
        linear: Vector3 = ...,
        angular: Vector3 = ...,
    ) -> None: ...

class TwistStamped(genpy.Message):
    header: std_msgs.msg.Header
    twist: Twist
    def __init__(
        self,
        header: std_msgs.msg.Header = ...,
        twist: Twist = ...,
    ) -> None: ...

class Vector3(genpy.Message):
    x: float
    y: float
    z: float
    def __init__(
        self,
        x: float = ...,
        y: float = ...,
        z: float = ...,
    ) -> None: ...

class Wrench(genpy.Message):
    force: Vector3
    torque: Vector3
    def __init__(
        self,
        force: Vector3 = ...,
        torque: Vector3 = ...,
    ) -> None: ...

class WrenchStamped(genpy.Message):
    header: std_msgs.msg.Header
    wrench: Wrench
    def __init__(
        self,
        header: std_msgs.msg.Header = ...,
        wrench: Wrench = ...,
    ) -> None: ...
