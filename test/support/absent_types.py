"""A command that imports the driver's ROS layer on one jaka_msgs after another, and prints what it offers on each:

    python3 test/support/absent_types.py FOLDER ..

For each folder, which holds a Python package jaka_msgs, a line of JSON: ``services`` with their types, ``topics`` and
``actions`` that are offered, ``warnings``, and ``error``, a text where something could not be imported or made. Each is
done in a process of its own, forked when all that does not depend on jaka_msgs is imported.
"""
import importlib
import json
import logging
import os
import pkgutil
import sys
import traceback
from unittest.mock import MagicMock, patch


def import_all():
    """Import every module of the ROS layer."""
    room = importlib.import_module("jaka_ros_driver.ros")
    for module in pkgutil.walk_packages(room.__path__, room.__name__ + "."):
        importlib.import_module(module.name)


def offered(folder):
    """Return what the ROS layer offers with the jaka_msgs of this folder."""
    warnings, topics, actions, services = [], [], [], {}
    handler = logging.Handler()
    handler.emit = lambda record: warnings.append(record.getMessage())
    logging.getLogger("jaka_ros_driver").addHandler(handler)
    sys.path.insert(0, folder)
    import_all()
    for name in sorted(os.listdir(os.path.join(folder, "planted")) if os.path.isdir(folder + "/planted") else ()):
        with open(os.path.join(folder, "planted", name)) as planted:
            exec(compile(planted.read(), name, "exec"), {})
    ros = sys.modules
    table, audit = ros["jaka_ros_driver.ros.services.table"], MagicMock()
    with patch("rospy.Publisher", lambda name, *_, **__: topics.append(name) or MagicMock()), \
            patch("rospy.resolve_name", str), \
            patch.object(table, "ServiceServer", lambda name, kind, *_: services.update({name: kind._type})):
        ros["jaka_ros_driver.ros.services.call_publisher"].CallPublisher()
        ros["jaka_ros_driver.ros.topics.io_states"].IoPublisher(None, None)
        ros["jaka_ros_driver.ros.topics.motion_ends"].MotionEnds(None)
        names = dict.fromkeys(("frame_prefix", "base_frame", "flange_frame", "tool_frame", "joint_states_topic"), "")
        config, arm = MagicMock(publish_rate=125.0, **names), MagicMock()
        arm.settings.feed_period = 0.008
        states = ros["jaka_ros_driver.ros.topics.state_publishers"]
        with patch.object(states, "ros_clock"):
            states.StatePublishers(arm, config, MagicMock())
        table.Services(None, None, None, audit).offer()
        for module, server in (("recover_action", "RecoverAction"), ("path_action", "PathAction")):
            action = ros["jaka_ros_driver.ros.services." + module]
            parts = (arm, audit) if server == "RecoverAction" else (arm, None, audit)
            with patch.object(action, "QuietActionServer", lambda name, *_: actions.append(name) or MagicMock()):
                getattr(action, server)(*parts).offer()
    return {"services": services, "topics": topics, "actions": actions, "warnings": warnings}


def main():
    """Print the lines."""
    import_all()  # so that each child need not import again what does not depend on jaka_msgs
    for name in list(sys.modules):
        if name.startswith(("jaka_msgs", "jaka_ros_driver.ros")):
            del sys.modules[name]
    for folder in sys.argv[1:]:
        child = os.fork()
        if not child:
            try:
                line = offered(folder)
            except BaseException:
                line = {"error": traceback.format_exc()}
            print(json.dumps(line), flush=True)
            os._exit(0)
        os.waitpid(child, 0)


if __name__ == "__main__":
    main()
