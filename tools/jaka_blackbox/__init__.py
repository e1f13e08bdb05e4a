"""A recorder that keeps the newest messages in memory and writes a file around each accident; the page about one.

On top of ``jaka_bag``; the rooms, from the ground up:

expression   conditions on fields of messages, as users write them
triggers     what sets the black box off
files        the files in their folder: names, how many are kept
recorder     the memory, and the files that triggers make of it
evidence     what a file needs besides its messages: parameters, the arm, versions, the clock
service      ``~trigger``, a service to set it off
incident     what happened around an accident, as a page
cli          the command lines: ``jaka_bag record --black-box``, ``jaka_bag report``
"""
