"""Custody of the arm, as pure state machines: events in, actions out; no thread, socket, clock or log.

actions         the actions that the core returns to the shell around it
channel         requests and their replies
link            one connection and its retries
links           both links to one controller, and whose they are
feed            status frames: which of them are fresh
witness         the comparison of the feed with the controller's answers, which detects an old feed
stillness       evidence that the arm rests
motion          the base class of all motions
motion_guard    what hits itself or a zone, or cannot be followed: asked before a motion and while it lasts
contradictions  one table of what forbids a motion to begin and what ends one
phases          the phases of custody, and the events between them: one table
custody         from before a motion's first byte until evidence that the arm rests
requests        who may take custody next, and what each kind of request does then
arrival         evidence that a planned motion has no way left to go
move            a planned move, or several that are queued
jog             a jog with a watchdog
servo_planner   servo targets to one frame a cycle
servo_trace     the positions where the arm may be while it is streamed
stops           the stop of this driver's motion, and of an arm that somebody else may move
foreign_motion  a motion that a dead driver left, and an arm that moves in nobody's custody
streaming       the base class of motions in servo mode: entered, one frame a cycle, left
servo           servo mode for a client that streams targets
trajectory      a joint trajectory, streamed along its audited path
point_stream    a stream of single trajectory points, and its gate
velocity_jog    a jog that lasts while fresh messages come: dead-man, ramp, motion
planned         motions that the controller plans as a whole: paths of several segments, programs of its own
procedures      sequences of several requests, as generators: session, power, settings
arm_core        routes events and calls
invariants      what holds of the core after every event; checked by the tests
"""
