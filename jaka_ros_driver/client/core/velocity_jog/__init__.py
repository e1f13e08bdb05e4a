"""A velocity jog: the arm moves only while fresh messages of one publisher come.

dead_man       which messages count, and when the dead-man is released
ramp           wanted velocities to one joint position a cycle within all limits
line           the way of the tool in the asked direction
line_follower  the joints that lead the tool along it, and brake on it
motion         the motion
"""
