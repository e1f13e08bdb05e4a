"""The arm maker's published definitions of jaka_msgs, as facts: names, fields, md5.

Read in JakaCobot/jaka_robot: src/jaka_msgs (commit 78546d94), jaka_robot_v2.2/src/jaka_msgs (commit bf298daf). The
fields of ClearError.srv, and the md5 of ClearError, RobotMsg, SetTcpFrame and of the requests of ServoMove and GetFK,
are those of code that others generated from these packages and published. Public states of the package from 2023-08 to
2025-07 were seen to have ClearError.srv, and none of them ClearErr.srv. An index of public code has one content of each
file; of the states beside these two commits it is not known whether each of their files is that one.
"""
from pathlib import Path
from typing import Iterable

from genpy.generate_initpy import write_modules
from genpy.generator import MsgGenerator, SrvGenerator

RESULT = "int16 ret\nstring message\n"
SERVICES = {
    "ClearError": ("bool enable\n", RESULT, "0fff944f16f37b02ba85acd57d94215a"),
    "GetFK": ("float32[] joint\n", "float32[] cartesian_pose\nstring message\n", "10d9bfd5c1accf4678c49f520f9480b8"),
    "GetIK": ("float32[] ref_joint\nfloat32[] cartesian_pose\n",
              "float32[] joint\nstring message\n", "33a7ddff09d4b5dc0322950ee926aea6"),
    "GetIO": ("string signal\nint16 path\nint16 type\nint16 index\n",
              "float32 value\nstring message\n", "6ff1cb5f4f299720705884f0c89f9d08"),
    "Move": ("float32[] pose\nbool has_ref\nfloat32[] ref_joint\nfloat32 mvvelo\nfloat32 mvacc\nfloat32 mvtime\n"
             "float32 mvradii\nint16 coord_mode\nint16 index\n", RESULT, "bfcaec3e81ace5826d9d96166632c9d1"),
    "ServoMove": ("float32[] pose\nfloat32[] speed\n", RESULT, "ea058e08a9ca2790743a486fd4bfb151"),
    "ServoMoveEnable": ("bool enable\n", RESULT, "0fff944f16f37b02ba85acd57d94215a"),
    "SetCollision": ("bool is_enable\nint16 value\n", RESULT, "192c4b02f65b62b6f0470ca351b4f7cc"),
    "SetIO": ("string signal\nint16 type\nint16 index\nfloat32 value\n", RESULT, "d70f55fb8350e7d75cb38e91f1bc0373"),
    "SetPayload": ("int16 tool_num\nfloat32 mass\nfloat32 xc\nfloat32 yc\nfloat32 zc\n",
                   RESULT, "dbe0292cc6f9be694a93bf981dcc8471"),
    "SetTcpFrame": ("float32[] pose\nint16 tool_num\n", RESULT, "3d15cf469e59f026a4e4b350932a8496"),
    "SetUserFrame": ("float32[] pose\nint16 user_num\n", RESULT, "f74c56afc671b9ccd78097ad9fa9b7ce"),
}
"""Fields of request and response, and the md5, of each service."""
MESSAGES = {"RobotMsg": ("int16 motion_state\nint16 power_state\nint16 servo_state\nint16 collision_state\n",
                         "cb4726a69178af69dc31d5013f095556")}
"""Fields and md5 of each message."""
REQUESTS = {"GetFK": "edecb4b6fff50f927a908742515e167a", "ServoMove": "0da71b9828204eece05ec950e45db9d9",
            "SetTcpFrame": "64d9a8fcd4a1fe5623c2ecb2890f780e"}
"""Published md5 of the request alone."""
STATES = {"src": {*SERVICES, *MESSAGES}, "jaka_robot_v2.2/src": {*SERVICES, *MESSAGES}}
"""The types of each published package."""


def generate(folder: Path, names: Iterable[str]) -> Path:
    """Write the Python package jaka_msgs with these published types into a folder, and return the folder."""
    package = folder / "jaka_msgs"
    for kind, generator in (("msg", MsgGenerator()), ("srv", SrvGenerator())):
        source = folder / "definitions" / kind
        source.mkdir(parents=True)
        for name in sorted(names):
            if kind == "srv" and name in SERVICES:
                (source / (name + ".srv")).write_text("---\n".join(SERVICES[name][:2]))
            elif kind == "msg" and name in MESSAGES:
                (source / (name + ".msg")).write_text(MESSAGES[name][0])
        files = sorted(map(str, source.iterdir()))
        (package / kind).mkdir(parents=True)
        if files:
            assert generator.generate_messages("jaka_msgs", files, str(package / kind),
                                               {"jaka_msgs": [str(folder / "definitions" / "msg")]}) == 0
        write_modules(str(package / kind))
        (package / kind / "__init__.py").touch()
    (package / "__init__.py").touch()
    return folder
