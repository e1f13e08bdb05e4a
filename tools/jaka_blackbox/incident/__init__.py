"""The report of an accident: a part of a log, second by second, as a page.

loading   the part of a log around its trigger: joints, poses, states, calls, diagnostics, losses
seconds   what happened in each second
page      all of it as one HTML page
"""
