"""What of the candidate belongs to what of the golden log.

course           where tolerances decide about the course of a comparison, and how far they could be other
sequences        pairs of equal entries of two sequences
curve_distance   how far samples are from a curve whose times are uncertain
motion_fit       lag and pace of motions by Gauss-Newton
alignment        the candidate's time for a golden time: by events, then by all joints together
cut_motions      motions that were stopped: how far off the arm may stand afterwards
"""
