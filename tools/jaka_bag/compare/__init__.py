"""Does the arm still do what it did? Compares two state logs, the golden one and a candidate.

The shelf, from the ground up; a module imports only from those above it in this list:

tolerances        how far the candidate may be off, from YAML
course            where tolerances decide about the course of a comparison, and how far they could be other
rotation_angles   angles between orientations
run               one log as streams, joints, poses, states and calls, times in s
track_facts       what is learnt from samples as they pass once: steps, motions, changes of state
windows           a log in windows of time, of which the last ones are kept
sequences         pairs of equal entries of two sequences
loading           a log read into a run
curve_distance    how far samples are from a curve whose times are uncertain
motion_fit        lag and pace of motions by Gauss-Newton
alignment         the candidate's time for a golden time: by events, then by all joints together
verdict           the outcome of one check, and of all
stream_checks     types, counts, rates, jitter, gaps, stamps
cut_motions       motions that were stopped: how far off the arm may stand afterwards
timing_checks     timing and pace of each motion, and whether the candidate holds all of them
motion_checks     joints, positions, orientations, other fields
state_checks      sequences of states
call_checks       sequences of service calls
comparison        all checks in their order
report            the result for people and machines
"""
