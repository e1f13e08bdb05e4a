"""Does the arm still do what it did? Compares two state logs, the golden one and a candidate.

The shelf, from the ground up; a room imports only from those above it in this list:

tolerances   how far the candidate may be off, from YAML
runs         a log as streams, joints, poses, states and calls, all on one clock
matching     the candidate's time for a golden time; equal entries of two sequences; distances of curves
verdict      the outcome of one check, and of all
checks       what is checked, one module a subject
comparison   all checks in their order
report       the result for people and machines
"""
