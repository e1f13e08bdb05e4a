"""A velocity jog: the arm moves only while fresh messages of one publisher say so.

dead_man      which messages count, and when the hand has let go
ramp          velocities that are asked for, to one joint position a cycle within all limits
velocity_jog  the motion
"""
