"""Debian's names of what package.xml asks for, as variables for debian/control: argv is package.xml.

By Debian's custom the Python package of a ROS package a_b is python3-a-b. What follows another rule stands in a table.
"""
import sys
from xml.etree import ElementTree

ELSEWHERE = {
    "message_runtime": None,  # for code in C++: libjaka-msgs-dev depends on it
    "python3-aiohttp": None,  # for jaka-panel, which depends on it, and jaka_foxglove
    "python3-lz4": None,  # for jaka_bag: python3-jaka-bag has its own metadata
    "python3-rosbags-pip": None,
    "jaka_msgs": None,  # only where JAKA_MSGS_EXTERNAL asks for it
}
OPTIONAL = {"robot_state_publisher": "ros-robot-state-publisher"}


def debian_name(key: str) -> str:
    """Return the package that brings the Python modules of a ROS package or rosdep key."""
    return key if key.startswith("python3-") else "python3-" + key.replace("_", "-")


def main() -> None:
    """Print the variables."""
    keys = {element.text or "" for tag in ("depend", "exec_depend")
            for element in ElementTree.parse(sys.argv[1]).getroot().iter(tag)}
    print("ros:Depends=" + ", ".join(sorted(debian_name(key) for key in keys - set(ELSEWHERE) - set(OPTIONAL))))
    print("ros:Suggests=" + ", ".join(sorted(OPTIONAL[key] for key in keys & set(OPTIONAL))))


if __name__ == "__main__":
    main()
