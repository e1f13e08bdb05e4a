"""The Python packages of jaka_ros_driver, for catkin_python_setup(); tools/pyproject.toml is for the log tools."""
import os

from catkin_pkg.python_setup import generate_distutils_setup
from setuptools import find_packages, setup

TOOLS = ("jaka_bag", "jaka_blackbox", "jaka_fleet", "jaka_foxglove", "jaka_migration", "jaka_panel", "jaka_regression")
WEB = os.path.join("tools", "jaka_panel", "web")
packages = find_packages(include=["jaka_ros_driver", "jaka_ros_driver.*"])
for name in TOOLS:
    packages += find_packages("tools", include=[name, name + ".*"])

# each by its name: setuptools of ROS Noetic knows no pattern for all folders below one
web_files = [os.path.relpath(os.path.join(folder, name), os.path.dirname(WEB))
             for folder, _, names in os.walk(WEB) for name in names]

setup(**generate_distutils_setup(
    packages=packages,
    package_dir={"": ".", **{name: "tools/" + name for name in TOOLS}},
    package_data={"jaka_ros_driver": ["py.typed"], "jaka_ros_driver.kinematics": ["data/*.yaml"],
                  **{name: ["py.typed"] + (web_files if name == "jaka_panel" else []) for name in TOOLS}},
))
