"""Custody of the arm, as pure state machines: events in, actions out; no thread, socket, clock or log.

arm_core            routes events and calls
admission           who may move the arm now, and who waits for that
custody, stillness  from before a motion's first byte until evidence that the arm rests
move, jog, servo    one motion each; servo_planner and servo_trace shape and watch a stream
link, channel       connections kept up; requests and their replies
feed                status frames: which of them are fresh
procedure           sequences of requests and conditions; settings, power, session are written as such
actions             what a shell is asked to do
"""
