"""The comparison of two state logs, the golden one and a candidate: does the arm still do what it did?

The layers, from the ground up; a room imports only from those above it in this list:

tolerances   limits for the candidate's deviations, from YAML
runs         a log as streams, joints, poses, states and calls, all on one clock
matching     the candidate's time for a golden time; equal entries of two sequences; distances of curves
verdict      the outcome of one check, and of all
checks       the checks, one module a subject
coverage     the share of both logs that the checks read
unmatched    names in tolerances that the golden log lacks
comparison   all checks in their order
learning     tolerances from runs that are known to be good
audit        defects planted into a golden log, and which of them a comparison misses
report       the result for people and machines
"""
