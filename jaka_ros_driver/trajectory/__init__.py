"""Joint trajectories: from points to an audited path, and the clock that runs along it. No thread, socket or ROS.

points       a client's trajectory: points of six joints, tolerances
path         polynomials between the points; position and velocity of each joint at each moment
splines      points with velocities, or with velocities and accelerations, to polynomials
corners      points without velocities: straight lines, rounded where the speed changes
build        the way from the arm's position onto the path
audit        the check of it all against the arm's limits
rates        lower rates of the clock where a path passes a limit by a little
clock_trace  the times at which the clock stood on its path
follower     streams of single points, within the limits of the joints
segments     paths of joint motions, lines and arcs that the controller runs: their audit, the arm's progress on them
clock        one step each cycle: speed scaling, pause and stop stay on the path and within the limits
"""
