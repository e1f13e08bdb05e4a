"""The simulated arm: its joints at each cycle. SI units; it has no clock and does no I/O.

plant                                  the arm as the controller uses it: commands in, joints and events out
moves, legs, routes, path_scan         from the numbers of a move to a path, and the highest speed on each stretch
profiles, follower, motion_queue       speed over time along a path, one path, and the queue of paths
jog, servo, servo_filters              jogging and servo (streaming) mode
hand_guiding, coasting                 moved by hand; coming to rest after drive power is lost
frames, limit_watch, events            kinematics with tool and user frame, the soft limits, the arm's events
"""
