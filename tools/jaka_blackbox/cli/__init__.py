"""The command lines of the black box.

record   the options of ``jaka_bag record`` for a black box, and its parts put together
report   what happened around an accident, as a page
"""
