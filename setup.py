"""The Python packages of jaka_ros_driver, for catkin_python_setup(); tools/pyproject.toml is for jaka_bag alone."""
from catkin_pkg.python_setup import generate_distutils_setup
from setuptools import find_packages, setup

TOOLS = ("jaka_bag", "jaka_regression")
packages = find_packages(include=["jaka_ros_driver", "jaka_ros_driver.*"])
for name in TOOLS:
    packages += find_packages("tools", include=[name, name + ".*"])

setup(**generate_distutils_setup(
    packages=packages,
    package_dir={"": ".", **{name: "tools/" + name for name in TOOLS}},
    package_data={"jaka_ros_driver": ["py.typed"], "jaka_ros_driver.kinematics": ["data/*.yaml"],
                  **{name: ["py.typed"] for name in TOOLS}},
))
