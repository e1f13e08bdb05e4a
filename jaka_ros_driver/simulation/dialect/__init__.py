"""The points on which nothing settles what a real controller does, each with its values. Data only: ``arm``,
``controller`` and ``server`` act on it.

dialect    the table of these points, and one choice of them: a controller that could be real
dimension  one point: its values, how one is checked and drawn
"""
