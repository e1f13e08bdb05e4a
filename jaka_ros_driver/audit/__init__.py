"""The audit log: who did what with the arm, as lines of JSON that are chained by their hashes.

chain     a line of the log, and its place in the chain
folder    the files of one log on disk: the newest, the next, the old ones
log       the queue, and the thread that writes, so that nobody waits for a disk
streams   one line at the begin and one at the end of a stream of messages

``jaka_bag verify`` reads it; docs/audit.md tells the format and what the log does not show.
"""
