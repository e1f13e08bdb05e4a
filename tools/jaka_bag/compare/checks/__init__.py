"""The checks, one module a subject.

rotation_angles   angles between orientations
stream_checks     types, counts, rates, jitter, gaps, stamps
timing_checks     timing and pace of each motion, and whether the candidate holds all of them
motion_checks     joints, positions, orientations, other fields
state_checks      sequences of states
content_checks    discrete fields, texts, arrays, messages published on change
call_checks       sequences of service calls
"""
