"""The command lines of the black box.

record   ``jaka_bag record`` with its three modes; the parts of a black box put together
report   what happened around an accident, as a page
"""
