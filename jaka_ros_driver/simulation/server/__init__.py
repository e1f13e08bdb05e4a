"""The sockets of the simulated controller.

event_loop                             one thread that serves every port and lets the arm's cycles pass
connection, request_parser             one client: requests cut out of its bytes, replies and when they go out
faults                                 the script of wire faults
cycle_clock                            when cycles and status frames are due
operator_actions, operator_session     the operator port's actions, and a session at it over stdin and stdout
"""
