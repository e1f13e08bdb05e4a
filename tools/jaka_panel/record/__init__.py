"""The records that are kept for pages that come later. Pure: no socket, thread or clock.

history  curves of the joints, with minimum and maximum where they are shortened
alarms   alarms and notes in the order of time
moves    motions, from begin to end
hand_outputs  outputs that pages have set, until something else sets them
"""
