"""The audit of a golden log: which of many planted defects would a comparison with it miss?

editing    a log as messages whose fields can be changed, and back
defects    the defects of topics: poses, joints, states, calls
streams    the defects of times: stamps, losses, waits, pace
auditing   the defects planted one at a time, and what the comparison says to each
"""
