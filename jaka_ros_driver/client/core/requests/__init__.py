"""Requests for the arm, which begin at once or wait until it is free and at rest.

admission  the base class of requests, and the queue of those that wait
kinds      one class for each kind of request: moves, paths, programs, jogs, streams, changes at rest
"""
