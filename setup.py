"""Python packages of jaka_ros_driver, for catkin_python_setup()."""
from catkin_pkg.python_setup import generate_distutils_setup
from setuptools import find_packages, setup

setup(**generate_distutils_setup(
    packages=find_packages(include=["jaka_ros_driver", "jaka_ros_driver.*"]),
    package_dir={"": "."},
    package_data={"jaka_ros_driver": ["py.typed"], "jaka_ros_driver.kinematics": ["data/*.yaml"]},
))
