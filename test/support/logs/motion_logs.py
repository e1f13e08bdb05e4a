"""Logs of arms that were led by hand, made from a formula, each wrong in one way where a test wants it so."""
import json
from pathlib import Path

import numpy as np
from synthetic_session import REST, SAMPLE_S, Conditions, Session, write_log

from jaka_bag.compare.runs.loading import load_run
from jaka_bag.containers.registry import create_log, open_log
from jaka_bag.containers.time_order import messages_of
from jaka_regression.motion.limits import limits_from_urdf
from jaka_regression.motion.recorded import recorded_joints
from jaka_ros_driver.kinematics.arm_models import load_model
from jaka_ros_driver.kinematics.urdf import urdf_from_model

JOINTS = ["joint_%d" % number for number in range(1, 7)]
BEFORE_S, AFTER_S = 1.5, 1.0
PUNCTUAL = Conditions(noise_rad=0.0, stamp_late_s=0.0005)


def led(time, seconds=4.0, reach=0.6):
    """Return the joints of an arm that a hand leads to and fro and then releases, rad (n, 6)."""
    inside = np.clip(time / seconds, 0.0, 1.0)[:, None]
    share = np.array([1.0, -0.7, 0.5, 0.3, -0.9, 0.2])
    hill = (inside * (1.0 - inside) * 4.0) ** 3
    return np.array(REST) + reach * share * hill * (1.0 + 0.3 * np.sin(9.0 * inside + np.arange(6)))


def session(seconds=4.0, reach=0.6, noise=0.0, before=BEFORE_S, after=AFTER_S, seed=1):
    """Return a session of that motion alone."""
    time = np.arange(0.0, before + seconds + after, SAMPLE_S)
    joints = led(time - before, seconds, reach)
    made = Session(time, joints, np.zeros((len(time), 4), np.int16), [], PUNCTUAL)
    made.joints = joints + np.random.RandomState(seed).normal(0.0, noise, joints.shape)
    return made


def log_of(path, *sessions):
    """Write sessions as a log of joints alone; .bag or .mcap."""
    for one in sessions:
        for topic in ("tool_position", "robot_states"):
            one.keep[topic][:] = False
    return write_log(Path(path), *sessions)


def recording_of(path, *sessions, **options):
    return recorded_joints(load_run(log_of(path, *sessions)), **options)


def limits_of(model="zu7"):
    return limits_from_urdf(urdf_from_model(load_model(model)), JOINTS)


def with_parameters(source, target, model, node="jaka_driver"):
    """Write the same log as if it had been recorded with the driver of this model running."""
    parameters = {"robot_description": urdf_from_model(load_model(model)), node: {"model": model}}
    with open_log(source) as reader, create_log(target) as writer:
        writer.add_attachment("rosparam.yaml", json.dumps(parameters).encode(), "application/yaml")
        numbers = [writer.add_channel(connection) for connection in reader.connections]
        for message in messages_of(reader):
            writer.add_message(numbers[reader.connections.index(message.connection)], message.log_time, message.data)
    return target
