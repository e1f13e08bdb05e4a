"""The drivers on the ROS graph, as any client sees them.

raw_messages   fields out of the bytes of messages that come 125 times a second
rotations      rotation vectors, roll pitch yaw
arms           which drivers there are, and what they offer
arm_feed       what one driver publishes: newest values, curves, events
requests       what a page may ask for, as calls of the driver's services
calls          calls in threads of their own, with a time limit
stopper        the stop: its own thread and connection
stop_link      that connection, on which every wait has a limit
registration   this node at a ROS master that was started anew
jog_publishers  the publishers of the driver's velocity jog topics
description    URDF, limits of the joints, meshes
arm_pose       the pose at which an arm rests, for points and teaching
motion_lists   lists of motions: planned with the driver, run through its paths
trajectories   trajectories to the driver's action
"""
