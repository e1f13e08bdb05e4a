"""The points on which nothing settles the behaviour of a real controller, each with its values.

Data only: ``arm``, ``controller`` and ``server`` act on it.

table      the table of these points, and one choice of them: a controller that could be real
dimension  one point: its values, their check, and how one is drawn
like       the choice that a report of jaka_probe describes
"""
