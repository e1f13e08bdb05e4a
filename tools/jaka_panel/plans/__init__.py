"""Motions that are drawn before they are run: what was drawn is what is run.

point_plan   from points of joints
log_plan     from a log; a process of its own, because it computes for seconds
motion_list  from a list of motions: joint motions, lines, arcs, waits, outputs
plan_store   the plans that pages may run, and the folder of logs
"""
