"""The slacks of the judge: how much later, older or nearer than the rule's own figure the arm may be, and why.

Each states what it is made of: frames of the slowest feed (0.1 s, generator.py), a turn of the driver's timer (0.02 s),
a cycle of the controller (0.008 s), the judge's look (0.04 s), one way on the wire (0.005 s at most). ``simulate.py``
prints the largest amount of a slack that its seeds needed.
"""
MOVING = 2e-3
"""rad/s; an arm with a faster joint moves."""
AT_REST = 5e-3
"""rad/s; an arm without a faster joint has completed its move."""
UNSEEN_WAY = 5e-4
"""rad; a driver notices a motion of 2e-4 rad (stillness.MOVEMENT), one or two frames later than it happens."""
UNOWNED = 0.3
"""s that an arm may move without custody: three frames of the slowest feed (0.1 s), the latest by which a driver sees
that it moves. None of it was needed in 500 seeds."""
REST_AFTER_STOP = 0.5
"""s; the generator's motions come to rest within 0.4 s; the rest is for the wire and the cycles of both sides. 0.39 s
were needed in 500 seeds."""
JOG_SLACK = 0.3
"""s; from a jog's deadline to rest, the figure in docs/safety.md: 0.26 s were needed at most in 2,300 seeds."""
JOG_LAG = 0.15
"""s; how far an arm follows behind the frames of a jog, at most: 0.10 s in 2,600 seeds."""
JOG_BRAKE = 0.1
"""s; for a process that wakes up in a jog: 0.08 s to brake from the fastest jog of 1 rad/s, and one turn of its
timer."""
STOP_AGAIN = 0.2
"""s; from the last refusal of a stop to the next one: the pause of the driver (0.05 s) or its guard (0.08 s), the turn
of its timer (0.02 s), two ways on the wire, and the judge's look (0.04 s)."""
SIGHT_SLACK = 0.3
"""s, over ``silence_timeout``: three frames of the slowest feed (0.1 s); the driver counts any byte as a sign of life,
the judge whole frames. None of it was needed in 500 seeds."""
UNTELLING = 0.006
"""rad; a feed that shows joints as near as this to where they are is not known to repeat itself."""
SHOWN_AGE = 0.15
"""s; how old a state may be that is shown as new, beside the wire's own latency: frames that waited behind a pause of
this length (feed.SILENCE_S) arrive in one piece and count as new."""
AGE_SLACK = 0.1
"""s, over ``silence_timeout``: the driver's timer (0.02 s), the wire's latency, one cycle (0.008 s), and a look of the
judge."""
OLD_NEWS = 0.3
"""s; after a frame that came on time and was not true: three frames of the slowest feed (0.1 s), after which true ones
have taken its place."""
SHOWN_PERIODS = 3.5
"""Periods of the feed; how old a state may be that is shown as new: a shorter pause of a slow feed looks like its
jitter."""
STOP_ANSWER_SLACK = 0.06
"""s, over the time-out of the reply: nothing else delays the answer to a stop but the driver's timer of 0.02 s and the
judge's look of 0.04 s; 0.016 s were needed in 1,500 seeds."""
ANSWER_SLACK = 3.5
"""s, over what a call may take by its settings: 1.5 s of waiting for rest and 2 s for servo mode to be confirmed. 2.1 s
were needed in 1,500 seeds."""
RECOVERY_SLACK = 3.5
"""s, over that: a recovery waits for rest, and twice for what clear_error does. 1,500 seeds needed none of it."""
LONGEST_TRAJECTORY = 300.0
"""s; a trajectory may be paused or slowed for most of a scenario."""
PAUSE_SLACK = 0.02
"""s; a pause is answered on rest that was seen, so that two cycles of the controller suffice."""
FREE_AFTER = 2.0
"""s; from the answer to the last stop, all being well, until custody has ended. A round figure: the driver's evidence
of rest takes 0.08 s, its longest pause before a connection 0.5 s, a reply that it still waits for ``reply_timeout``,
0.9 s."""
GUARD_AGAIN = 2.2
"""s; a guard that was turned away, or gets no reply, begins anew: 1 s to connect, 1 s for the reply, and its pauses."""
GUARD_ACTS = 0.35
"""s; from the driver's last sign of life: 0.25 s of silence, its turns of 20 ms, the connection, the request. With the
time to rest, 0.31 s more than REST_AFTER_STOP were needed in 2,200 seeds."""
GUARD_KILLS = 0.4
"""s; how long a guard is turned away (0.25 s) before it ends the driver's process, and then connects anew."""
LOOK_PERIOD = 0.04
"""s; how often the judge looks at what changes slowly: obstacles, calls that are not answered."""
