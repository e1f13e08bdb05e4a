"""The parts of the program that are about evidence of accidents.

black_box   the options of ``jaka_bag record`` for a black box, and its parts put together
report      what happened around an accident, as a page
verify      was a signed log changed?
"""
