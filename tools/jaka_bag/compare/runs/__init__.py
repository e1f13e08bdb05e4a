"""A log as the comparison sees it.

run           one log as streams, joints, poses, states and calls, times in s
track_facts   what is learnt from samples as they pass once: steps, motions, changes of state
call_text     requests of calls as they were typed, and their changes
contents      fields beyond joints, poses and states, as numbers and as sequences of values
publishers    two publishers of joints on one topic, and arrays of several lengths, as a track each
windows       a log in windows of time, of which the last ones are kept
loading       a log read into a run
"""
