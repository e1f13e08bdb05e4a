"""Checks of what a cell brings along when it comes to this driver; none of them needs ROS, or runs what it reads.

bounded_files   YAML and XML of anybody: bounded, with lines
package         the folder of a package, and what lies beside it
findings        the report, as a list for people or as JSON
expectations    what the driver wants of a configuration
urdf_chain      an arm in a URDF, and how far it is from a model
controllers     the files that name MoveIt's controllers
joint_limits    limits of joint_limits.yaml and of the URDF
semantics       the SRDF
launch_files    trajectory execution, controller managers, nodes
moveit_config   the program check_moveit_config
"""
