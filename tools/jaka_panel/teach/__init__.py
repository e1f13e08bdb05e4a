"""Frames and tools that are computed from poses at which the arm stood. Pure: numpy, no ROS, thread or clock.

user_frame   a frame by its origin, a point of its x axis and one of its xy plane
rotations    rotation matrices, rotation vectors, poses
tool_centre  the tip of a tool by poses in which it touches one place
"""
