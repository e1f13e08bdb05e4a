"""Checks of what a cell brings along when it comes to this driver; none of them needs ROS, or runs what it reads."""
