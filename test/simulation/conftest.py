"""The fixtures of the simulated controller, for every test in this folder."""
from simulation_fixtures import arm, client, feed, make_arm, nothing_left_behind

__all__ = ["arm", "client", "feed", "make_arm", "nothing_left_behind"]
