"""Programs for a cell that moves from the arm maker's packages to this one (docs/migration.md); none needs ROS.

cell            the program migrate_cell: reports what a cell has of the maker's driver, and changes its launch files
cell_files      the files below a folder, read and replaced without following a link
findings        what to look for in programs; each subject with its meaning there and what to do here
launch_changes  what a launch file has, and the edits with which it starts this driver
launch_file     launch files as bytes with the places of their elements
"""
