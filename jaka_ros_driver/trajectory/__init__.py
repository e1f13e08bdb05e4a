"""Joint trajectories: from points to an audited path, and the clock that runs along it. No thread, socket or ROS.

points    a client's trajectory: points of six joints, tolerances
path      polynomials between the points; position and velocity of each joint at each moment
splines   points with velocities, or with velocities and accelerations, to polynomials
corners   points without velocities: straight lines, rounded where the speed changes
build     the way from the arm's position onto the path, and the audit of it all
segments  paths of joint motions, lines and arcs that the controller runs: their audit, the arm's progress on them
clock     one step each cycle: speed scaling, pause and stop stay on the path and within the limits
"""
