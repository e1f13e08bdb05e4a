"""The checks, one module a subject.

rotation_angles   angles between orientations
stream_checks     types, counts, rates, jitter, gaps, stamps
timing_checks     timing and pace of each motion, and whether the candidate holds all that happens
reach_checks      whether both logs have samples at the same times
aligned_samples   the candidate's samples at golden times, beside the golden curve
not_numbers       NaN and infinite values, column by column
motion_checks     joints, positions, orientations, other fields
state_checks      sequences of states
content_checks    discrete fields, texts, arrays, messages published on change
call_checks       sequences of service calls
"""
