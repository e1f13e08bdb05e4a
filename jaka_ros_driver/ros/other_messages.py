"""Types of control_msgs, controller_manager_msgs, industrial_msgs and visualization_msgs, which are not installed
everywhere: the installed one, or one made here.

The definitions are of our own writing and have the fields of the published ones, so that their md5 is the same: with
another one no client that was built with the published definition would connect.
"""
import importlib
from typing import Any, Dict, Sequence, Set, Tuple

import genpy.dynamic

MD5 = {
    "control_msgs/FollowJointTrajectoryAction": "bc4f9b743838566551c0390c65f1a248",
    "control_msgs/FollowJointTrajectoryFeedback": "10817c60c2486ef6b33e97dcd87f4474",
    "control_msgs/JointTrajectoryControllerState": "10817c60c2486ef6b33e97dcd87f4474",
    "control_msgs/QueryTrajectoryState": "ec93cdecbd8062d761aa52b7c90cd44b",
    "controller_manager_msgs/ControllerState": "aeb6b261d97793ab74099a3740245272",
    "controller_manager_msgs/ListControllerTypes": "c1d4cd11aefa9f97ba4aeb5b33987f4e",
    "controller_manager_msgs/ListControllers": "1341feb2e63fa791f855565d0da950d8",
    "controller_manager_msgs/LoadController": "647e5c54b8d6468952d8d31f1efe96c0",
    "controller_manager_msgs/ReloadControllerLibraries": "40e8c411fd1797d2e2c486018f846040",
    "controller_manager_msgs/SwitchController": "b29a7abc673b2c54c14b54e50f8d06a5",
    "controller_manager_msgs/UnloadController": "647e5c54b8d6468952d8d31f1efe96c0",
    "industrial_msgs/StopMotion": "50b1f38f75f5677e5692f3b3e7e1ea48",
    "control_msgs/GripperCommandAction": "950b2a6ebe831f5d4f4ceaba3d8be01e",
    "industrial_msgs/RobotStatus": "b733cb45a38101840b75c4c0d6093d19",
    "visualization_msgs/MarkerArray": "d155b9ce5188fbaf89745847fd5882d7",
}
"""Checksums of the published definitions; controller_manager_msgs as in ROS Noetic."""
OLD_SWITCH_MD5 = "5e857dedf71d6f337975e15a1e7cfdd8"
"""Checksum of SwitchController before it had ``start_asap`` and ``timeout`` (ros_control 0.13, ROS Kinetic)."""
_DEFINITIONS = {
    "actionlib_msgs/GoalID": "time stamp\nstring id\n",
    "actionlib_msgs/GoalStatus": (
        "GoalID goal_id\nuint8 status\nuint8 PENDING=0\nuint8 ACTIVE=1\nuint8 PREEMPTED=2\nuint8 SUCCEEDED=3\n"
        "uint8 ABORTED=4\nuint8 REJECTED=5\nuint8 PREEMPTING=6\nuint8 RECALLING=7\nuint8 RECALLED=8\nuint8 LOST=9\n"
        "string text\n"),
    "control_msgs/FollowJointTrajectoryAction": (
        "FollowJointTrajectoryActionGoal action_goal\nFollowJointTrajectoryActionResult action_result\n"
        "FollowJointTrajectoryActionFeedback action_feedback\n"),
    "control_msgs/FollowJointTrajectoryActionFeedback": (
        "Header header\nactionlib_msgs/GoalStatus status\nFollowJointTrajectoryFeedback feedback\n"),
    "control_msgs/FollowJointTrajectoryActionGoal": (
        "Header header\nactionlib_msgs/GoalID goal_id\nFollowJointTrajectoryGoal goal\n"),
    "control_msgs/FollowJointTrajectoryActionResult": (
        "Header header\nactionlib_msgs/GoalStatus status\nFollowJointTrajectoryResult result\n"),
    "control_msgs/FollowJointTrajectoryFeedback": (
        "Header header\nstring[] joint_names\ntrajectory_msgs/JointTrajectoryPoint desired\n"
        "trajectory_msgs/JointTrajectoryPoint actual\ntrajectory_msgs/JointTrajectoryPoint error\n"),
    "control_msgs/FollowJointTrajectoryGoal": (
        "trajectory_msgs/JointTrajectory trajectory\nJointTolerance[] path_tolerance\n"
        "JointTolerance[] goal_tolerance\nduration goal_time_tolerance\n"),
    "control_msgs/FollowJointTrajectoryResult": (
        "int32 error_code\nint32 SUCCESSFUL = 0\nint32 INVALID_GOAL = -1\nint32 INVALID_JOINTS = -2\n"
        "int32 OLD_HEADER_TIMESTAMP = -3\nint32 PATH_TOLERANCE_VIOLATED = -4\nint32 GOAL_TOLERANCE_VIOLATED = -5\n"
        "string error_string\n"),
    "control_msgs/GripperCommand": "float64 position\nfloat64 max_effort\n",
    "control_msgs/GripperCommandAction": (
        "GripperCommandActionGoal action_goal\nGripperCommandActionResult action_result\n"
        "GripperCommandActionFeedback action_feedback\n"),
    "control_msgs/GripperCommandActionFeedback": (
        "Header header\nactionlib_msgs/GoalStatus status\nGripperCommandFeedback feedback\n"),
    "control_msgs/GripperCommandActionGoal": (
        "Header header\nactionlib_msgs/GoalID goal_id\nGripperCommandGoal goal\n"),
    "control_msgs/GripperCommandActionResult": (
        "Header header\nactionlib_msgs/GoalStatus status\nGripperCommandResult result\n"),
    "control_msgs/GripperCommandFeedback": (
        "float64 position       # m, or rad\nfloat64 effort         # N\nbool stalled\nbool reached_goal\n"),
    "control_msgs/GripperCommandGoal": "GripperCommand command\n",
    "control_msgs/GripperCommandResult": (
        "float64 position       # m, or rad\nfloat64 effort         # N\nbool stalled\nbool reached_goal\n"),
    "control_msgs/JointTolerance": (
        "string name\nfloat64 position       # rad; 0: the default, negative: none\nfloat64 velocity\n"
        "float64 acceleration\n"),
    "control_msgs/JointTrajectoryControllerState": (
        "Header header\nstring[] joint_names\ntrajectory_msgs/JointTrajectoryPoint desired\n"
        "trajectory_msgs/JointTrajectoryPoint actual\ntrajectory_msgs/JointTrajectoryPoint error\n"),
    "control_msgs/QueryTrajectoryStateRequest": "time time\n",
    "control_msgs/QueryTrajectoryStateResponse": (
        "string[] name\nfloat64[] position       # rad\nfloat64[] velocity       # rad/s\n"
        "float64[] acceleration   # rad/s2\n"),
    "controller_manager_msgs/ControllerState": (
        "string name\nstring state\nstring type\n"
        "controller_manager_msgs/HardwareInterfaceResources[] claimed_resources\n"),
    "controller_manager_msgs/HardwareInterfaceResources": "string hardware_interface\nstring[] resources\n",
    "controller_manager_msgs/ListControllerTypesRequest": "# empty\n",
    "controller_manager_msgs/ListControllerTypesResponse": "string[] types\nstring[] base_classes\n",
    "controller_manager_msgs/ListControllersRequest": "# empty\n",
    "controller_manager_msgs/ListControllersResponse": "controller_manager_msgs/ControllerState[] controller\n",
    "controller_manager_msgs/LoadControllerRequest": "string name\n",
    "controller_manager_msgs/LoadControllerResponse": "bool ok\n",
    "controller_manager_msgs/OldSwitchControllerRequest": (
        "string[] start_controllers\nstring[] stop_controllers\nint32 strictness\nint32 BEST_EFFORT=1\n"
        "int32 STRICT=2\n"),
    "controller_manager_msgs/ReloadControllerLibrariesRequest": "bool force_kill\n",
    "controller_manager_msgs/ReloadControllerLibrariesResponse": "bool ok\n",
    "controller_manager_msgs/SwitchControllerRequest": (
        "string[] start_controllers\nstring[] stop_controllers\nint32 strictness\nint32 BEST_EFFORT=1\n"
        "int32 STRICT=2\nbool start_asap\nfloat64 timeout       # s\n"),
    "controller_manager_msgs/SwitchControllerResponse": "bool ok\n",
    "controller_manager_msgs/UnloadControllerRequest": "string name\n",
    "controller_manager_msgs/UnloadControllerResponse": "bool ok\n",
    "geometry_msgs/Point": "float64 x\nfloat64 y\nfloat64 z\n",
    "geometry_msgs/Pose": "Point position\nQuaternion orientation\n",
    "geometry_msgs/Quaternion": "float64 x\nfloat64 y\nfloat64 z\nfloat64 w\n",
    "geometry_msgs/Vector3": "float64 x\nfloat64 y\nfloat64 z\n",
    "industrial_msgs/RobotMode": "int8 val\nint8 UNKNOWN=-1\nint8 MANUAL=1\nint8 AUTO=2\n",
    "industrial_msgs/RobotStatus": (
        "Header header                   # stamp: arrival of the status frame that tells this; frame_id: empty\n"
        "industrial_msgs/RobotMode mode\nindustrial_msgs/TriState e_stopped\n"
        "industrial_msgs/TriState drives_powered\nindustrial_msgs/TriState motion_possible\n"
        "industrial_msgs/TriState in_motion\nindustrial_msgs/TriState in_error\n"
        "int32 error_code                # entry of the controller's event list, 0 for no error\n"),
    "industrial_msgs/ServiceReturnCode": "int8 val\nint8 SUCCESS=1\nint8 FAILURE=-1\n",
    "industrial_msgs/StopMotionRequest": "# empty\n",
    "industrial_msgs/StopMotionResponse": "industrial_msgs/ServiceReturnCode code\n",
    "industrial_msgs/TriState": (
        "int8 val\nint8 UNKNOWN=-1\nint8 TRUE=1\nint8 ON=1\nint8 ENABLED=1\nint8 HIGH=1\nint8 CLOSED=1\nint8 FALSE=0\n"
        "int8 OFF=0\nint8 DISABLED=0\nint8 LOW=0\nint8 OPEN=0\n"),
    "std_msgs/ColorRGBA": "float32 r\nfloat32 g\nfloat32 b\nfloat32 a\n",
    "std_msgs/Header": "uint32 seq\ntime stamp\nstring frame_id\n",
    "trajectory_msgs/JointTrajectory": "Header header\nstring[] joint_names\nJointTrajectoryPoint[] points\n",
    "trajectory_msgs/JointTrajectoryPoint": (
        "float64[] positions\nfloat64[] velocities\nfloat64[] accelerations\nfloat64[] effort\n"
        "duration time_from_start\n"),
    "visualization_msgs/Marker": (
        "uint8 ARROW=0\nuint8 CUBE=1\nuint8 SPHERE=2\nuint8 CYLINDER=3\nuint8 LINE_STRIP=4\nuint8 LINE_LIST=5\n"
        "uint8 CUBE_LIST=6\nuint8 SPHERE_LIST=7\nuint8 POINTS=8\nuint8 TEXT_VIEW_FACING=9\nuint8 MESH_RESOURCE=10\n"
        "uint8 TRIANGLE_LIST=11\nuint8 ADD=0\nuint8 MODIFY=0\nuint8 DELETE=2\nuint8 DELETEALL=3\nHeader header\n"
        "string ns\nint32 id\nint32 type\nint32 action\ngeometry_msgs/Pose pose\ngeometry_msgs/Vector3 scale\n"
        "std_msgs/ColorRGBA color\nduration lifetime\nbool frame_locked\ngeometry_msgs/Point[] points\n"
        "std_msgs/ColorRGBA[] colors\nstring text\nstring mesh_resource\nbool mesh_use_embedded_materials\n"),
    "visualization_msgs/MarkerArray": "Marker[] markers\n",
}
_SEPARATOR = "=" * 80 + "\nMSG: %s\n"
_made: Dict[str, Any] = {}


def message_type(name: str) -> Any:
    """Return the class of a message, as ``package/Name``: that of an installed package, else ``made_type``."""
    package, short = name.split("/")
    try:
        return getattr(importlib.import_module(package + ".msg"), short)
    except (ImportError, AttributeError):
        return made_type(name)


def made_type(name: str) -> Any:
    """Return a class made from the definitions of this file, the same on the wire; its fields' types are made, too.

    Those of one package are made at once, of grippers or of others: the time that genpy takes grows with the square of
    their number.
    """
    if name not in _made:
        wanted = _with_fields([other for other in _DEFINITIONS if _family(other) == _family(name)])
        parts = [_DEFINITIONS[name]]
        parts += [_SEPARATOR % other + _DEFINITIONS[other] for other in sorted(wanted) if other != name]
        for made, message in genpy.dynamic.generate_dynamic(name, "".join(parts)).items():
            _made.setdefault(made, message)
    return _made[name]


def _family(name: str) -> Tuple[str, bool]:
    return name.split("/")[0], "/Gripper" in name


def _with_fields(names: Sequence[str]) -> Set[str]:
    """Return types with those of their fields, and of their fields' fields."""
    found: Set[str] = set()
    left = list(names)
    while left:
        name = left.pop()
        found.add(name)
        for line in _DEFINITIONS[name].splitlines():
            field = line.split()[0].partition("[")[0]
            field = "std_msgs/Header" if field == "Header" else field
            field = field if "/" in field else "%s/%s" % (name.split("/")[0], field)
            if field in _DEFINITIONS and field not in found:
                left.append(field)
    return found


def service_type(name: str) -> Any:
    """Return the class of a service, as ``package/Name``: that of an installed package, else ``made_service``."""
    package, short = name.split("/")
    try:
        return getattr(importlib.import_module(package + ".srv"), short)
    except (ImportError, AttributeError):
        return made_service(name)


def made_service(name: str) -> Any:
    """Return a class of a service made from the definitions of this file, the same on the wire."""
    return service_class(name, MD5[name], made_type(name + "Request"), made_type(name + "Response"))


def stop_motion_type() -> Any:
    """Return the class of the service industrial_msgs/StopMotion."""
    return service_type("industrial_msgs/StopMotion")


def old_switch_type() -> Any:
    """Return the class of controller_manager_msgs/SwitchController with which clients of ros_control 0.13 are built."""
    name = "controller_manager_msgs/SwitchController"
    return service_class(name, OLD_SWITCH_MD5, made_type("controller_manager_msgs/OldSwitchControllerRequest"),
                         made_type(name + "Response"))


def service_class(name: str, md5sum: str, request: Any, response: Any) -> Any:
    """Return a class of a service, ``package/Name``, with these classes of its request and response."""
    return type(name.split("/")[1], (), {"_type": name, "_md5sum": md5sum, "_request_class": request,
                                         "_response_class": response})
