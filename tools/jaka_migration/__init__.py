"""Commands for a cell that moves here; none needs ROS, or runs what it reads.

cell            the command migrate_cell: reports what a cell has of the maker's driver, and changes its launch files
cell_files      the files below a folder, read and replaced without following a link
findings        what to look for in source files; each subject with its meaning there and what to do here
launch_changes  what a launch file has, and the edits with which it starts this driver
launch_file     launch files as bytes with the places of their elements
moveit_config   the command check_moveit_config
bounded_files   YAML and XML of anybody: bounded, with lines
package         the folder of a package, and what lies beside it
report          the findings of a check, as a list for people or as JSON
expectations    what the driver wants of a configuration
urdf_chain      an arm in a URDF, and how far it is from a model
controllers     the files that name MoveIt's controllers
joint_limits    limits of joint_limits.yaml and of the URDF
semantics       the SRDF
launch_files    trajectory execution, controller managers, nodes
launch_reading  launch files as they stand, with the values of their arguments
launch_links    files, arguments, descriptions and drivers that launch files name
"""
