"""A recorder that keeps the newest messages in memory and writes a file around each accident.

expression   conditions on fields of messages, as users write them
triggers     what sets the black box off
files        the files in their folder: names, how many are kept
recorder     the memory, and the files that triggers make of it
evidence     what a file needs besides its messages: parameters, the arm, versions, the clock
service      ``~trigger``, a service to set it off
"""
