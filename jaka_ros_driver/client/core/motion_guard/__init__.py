"""Motions asked before they begin and while they last: what hits itself, a zone or an end of what the arm can do.

motion_check  the check of every motion, as ``~guard_motion`` asks for it
tool_frames   the active tool and user frame, as the status feed and the controller's tables show them
line_walk     a line or an arc, walked by inverse kinematics in the branch of its start
joint_corner  the rounded corners at joint moves, as parabolas in joint space
clear_space   the space around the last look: motions within it need no look of their own
frame_guard   the guard of a stream of joint frames, which can stand before it touches
pose_guard    the same of a stream of poses, whose joints the driver's own inverse kinematics gives
feed_watch    the watch over motions that the controller plans, by the status feed
"""
