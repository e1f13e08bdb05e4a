"""The audit log of this node: what of its ROS interface is recorded, and as what.

recorder    from calls, goals and messages to lines of the log
callers     who made a call or published a message, and from which address
plain       messages as values of JSON, bounded
setting_up  the log of an arm by its parameters, and its first line
"""
