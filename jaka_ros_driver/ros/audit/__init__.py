"""The audit log of this node: its lines, made from the ROS interface.

recorder    from calls, goals and messages to lines of the log
callers     the node and the address that made a call or published a message
plain       messages as values of JSON, bounded
setting_up  the log of an arm by its parameters, and its first line
"""
