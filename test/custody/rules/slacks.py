"""The slacks of the judge: how much later, older or nearer than the rule's own figure the arm may be, and why.

Each states what it is made of: frames of the slowest feed (0.1 s, generator.py), a turn of the driver's timer (0.02 s),
a cycle of the controller (0.008 s), the judge's look (0.04 s), one way on the wire (0.005 s at most). ``simulate.py``
prints the largest amount of a slack that its seeds needed.
"""
MOVING = 2e-3
"""Speed of the fastest joint above which an arm moves, rad/s."""
AT_REST = 5e-3
"""Speed of the fastest joint below which an arm has completed its move, rad/s."""
UNSEEN_WAY = 5e-4
"""Motion that a driver has noticed, rad: it sees 2e-4 rad (stillness.MOVEMENT), one or two frames late."""
UNOWNED = 0.3
"""Time that an arm may move without custody, s: three frames of the slowest feed (0.1 s), the latest by which a driver
sees that it moves. None of it was needed in 500 seeds."""
REST_AFTER_STOP = 0.6
"""Time from a stop to rest, s: the generator's motions come to rest within 0.5 s, the longest of them lines that turn
the tool at 180 deg/s; the rest is for the wire and the cycles of both sides. seed 95000175 needed 0.52 s."""
JOG_SLACK = 0.3
"""Time from a jog's deadline to rest, s, the figure in docs/safety.md: at most 0.26 s were needed in 2,300 seeds."""
JOG_STOP = 0.1
"""Time from a jog's deadline to the execution of its stop, s, for an arm that brakes longer: 0.35 s where it turned its
tool at 28 deg/s beside a singularity (seed 9000009)."""
JOG_LAG = 0.15
"""Time by which an arm follows behind the frames of a jog, s: at most 0.10 s in 2,600 seeds."""
JOG_BRAKE = 0.1
"""Time to rest for a process that wakes up in a jog, s: 0.08 s to brake from the fastest jog of 1 rad/s, and one turn
of its timer."""
STOP_AGAIN = 0.2
"""Time from the last refusal of a stop to the next one, s: the pause of the driver (0.05 s) or its guard (0.08 s), the
turn of its timer (0.02 s), two ways on the wire, and the judge's look (0.04 s)."""
SIGHT_SLACK = 0.3
"""Slack over ``silence_timeout``, s: three frames of the slowest feed (0.1 s); the driver counts any byte as a sign of
life, the judge whole frames. None of it was needed in 500 seeds."""
UNTELLING = 0.006
"""Distance from the true joints, rad, within which a feed is not known to repeat itself."""
SHOWN_AGE = 0.15
"""Age of a state that is shown as new, s, beside the wire's own latency, at most: frames that waited behind a pause of
this length (feed.SILENCE_S) arrive in one piece and count as new."""
AGE_SLACK = 0.1
"""Slack over ``silence_timeout``, s: the driver's timer (0.02 s), the wire's latency, one cycle (0.008 s), and the
judge's look."""
STOOD_AGE = 0.3
"""More of it after a pause of the process on a slow link, s, the figure in docs/safety.md: 0.21 s were needed in seed
8000965, of three frames of the slowest feed (0.1 s)."""
OLD_NEWS = 0.3
"""Time after a frame that came on time and was not true, s: three frames of the slowest feed (0.1 s), after which true
ones have taken its place."""
SHOWN_PERIODS = 3.5
"""Periods of the feed; how old a state may be that is shown as new: a shorter pause of a slow feed looks like its
jitter."""
STOP_ANSWER_SLACK = 0.06
"""Slack over the time-out of the reply, s: nothing else delays the answer to a stop but the driver's timer of 0.02 s
and the judge's look of 0.04 s; 0.016 s were needed in 1,500 seeds."""
ANSWER_SLACK = 4.3
"""Slack over what a call may take by its settings, s: 2.3 s of waiting for rest and 2 s for servo mode to be confirmed.
2.1 s were needed in 1,500 seeds."""
RECOVERY_SLACK = 3.5
"""Slack of a recovery over ANSWER_SLACK, s: waits for rest and for two clear_error. 1,500 seeds needed none."""
LONGEST_TRAJECTORY = 300.0
"""Longest trajectory, s; it may be paused or slowed for most of a scenario."""
PAUSE_SLACK = 0.02
"""Slack of a pause, s: it is answered on rest that was seen, so that two cycles of the controller suffice."""
FREE_AFTER = 2.5
"""Time from the answer to the last stop, all being well, until custody has ended, s.

A round figure: the driver's evidence of rest takes 0.8 s after a stop in doubt, its longest pause before a connection
0.5 s, a reply that it still waits for ``reply_timeout``, 0.9 s."""
GUARD_AGAIN = 2.2
"""Time until a guard turned away, or without a reply, begins anew, s: 1 s to connect, 1 s for the reply, its pauses."""
GUARD_ACTS = 0.35
"""Time from the driver's last sign of life to the guard's stop, s: 0.25 s of silence, its turns of 20 ms, the
connection, the request. With the time to rest, 0.31 s more than REST_AFTER_STOP were needed in 2,200 seeds."""
GUARD_KILLS = 0.4
"""Time, s, for a guard that is turned away (0.25 s) to end the driver's process, and to connect anew."""
NEARER = 0.005
"""Distance, m, by which a motion may come nearer than the margin: 2.5 mm between two looks (in and out within
guard.FINEST_STEP, 5 mm), and 2.5 mm on a trajectory, whose places are 0.04 s apart: a joint at 12.5 rad/s2 is 2.5 mrad
beside the line between two of them, at a lever of 1 m."""
NEARER_STILL = 1e-4
"""Distance, m, by which an arm within the margin may come nearer still: a trajectory begins at its own first point."""
LOOK_PERIOD = 0.04
"""Period, s, of the judge's look at what changes slowly: obstacles, calls that are not answered."""
