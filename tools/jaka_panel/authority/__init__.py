"""The rules of who may move the arm, and on which heartbeats. Pure: no socket, thread or clock.

control   one page has control; another one asks for it
jog_hold  the dead-man between a page that holds a button and the driver's velocity jog
rate_limiter  how much a peer may send
frames    WebSocket frames in a stream of bytes, counted before anything reads them
"""
