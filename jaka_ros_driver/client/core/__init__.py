"""Custody of the arm, as pure state machines: events in, actions out; no thread, socket, clock or log.

actions         what the shell around is asked to do
channel         requests and their replies
link            keeps one connection up
links           both links to one controller, and whose they are
feed            status frames: which of them are fresh
witness         what the controller answers must appear in the feed: it tells a feed that is old
stillness       evidence that the arm rests
motion          what all motions have in common
contradictions  what forbids a motion to begin and what ends one, as one table
custody         from before a motion's first byte until evidence that the arm rests; who may take it next
arrival         evidence that a planned motion has no way left to go
move            a planned move, or several that are queued
jog             goes on as long as it is called for
servo_planner   servo targets to one frame a cycle
servo_trace     where the arm may be while it is streamed
stops           of what this driver moves, and of an arm that somebody else may move
foreign_motion  what a dead driver left moving, and an arm that moves in nobody's custody
streaming       what motions in servo mode have in common: entered, one frame a cycle, left
servo           servo mode for a client that streams targets
trajectory      a joint trajectory, streamed along its audited path
velocity_jog    the arm moves only while fresh messages say so: dead-man, ramp, motion
planned         what the controller plans as a whole: paths of several segments, programs of its own
procedures      what takes several requests, as generators: session, power, settings
arm_core        routes events and calls
"""
