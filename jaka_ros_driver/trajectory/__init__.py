"""Joint trajectories: from points to an audited path, and the clock that runs along it. No thread, socket or ROS.

points    what a client asks for: points of six joints, tolerances
path      polynomials between the points; where a joint is, how fast, at each moment
splines   points with velocities, or with velocities and accelerations, to polynomials
corners   points without velocities: straight lines, rounded where the speed changes
build     from where the arm is onto the path, and the audit of it all
segments  paths of joint motions, lines and arcs that the controller runs: their audit, how far an arm has come
clock     one step each cycle: speed scaling, pause and stop stay on the path and within the limits
"""
