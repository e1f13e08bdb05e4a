"""Recorders that keep the newest messages in memory: a file around each accident, with a page about it; snapshots.

On top of ``jaka_bag``; the rooms, from the ground up:

expression   conditions on fields of messages, as users write them
triggers     what sets the black box off
files        the files in their folder: names, how many are kept
recorder     the memory, and the files that triggers make of it
model_file   the arm model file that a parameter names
evidence     what a file needs besides its messages: parameters, the arm, versions, the clock
service      ``~trigger``, a service to set it off
snapshots    a file of what is in memory at each signal
incident     what happened around an accident, as a page
cli          the command lines: ``jaka_bag record``, ``jaka_bag report``
"""
