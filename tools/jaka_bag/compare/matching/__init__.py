"""The assignment of the candidate's times and entries to those of the golden log.

course           decisions about the course of a comparison, and the tolerances that would leave it the same
sequences        pairs of equal entries of two sequences
state_pairing    pairs of states of two sequences, of which brief ones may be missing
curve_distance   distances of samples from a curve whose times are uncertain
motion_fit       lag and pace of motions by Gauss-Newton
alignment        the candidate's time for a golden time: by events, then by all joints together
cut_motions      motions that were stopped: the allowed deviation of the arm afterwards
"""
