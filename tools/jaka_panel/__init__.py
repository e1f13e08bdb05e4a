"""The operator's panel: a page in a browser, to see running drivers and to hold them.

It is a client of the drivers like any other: topics and services. Of the driver's code it uses the writer of the audit
log, for a log of its own; of ``jaka_regression`` the plan of a log's motion and the client of trajectories.

command    the command jaka_panel: options, start, end
settings   what a user can set
authority  who may move the arm, and while which heartbeats: pure, fed with events and the time
record     what is kept to be shown: curves of the joints, alarms; pure
graph      the drivers on the ROS graph: topics, services, descriptions
cell       the data of a cell, in one file: names, points, frames, payloads, lists of motions
teach      frames and tools from poses: pure, numpy
plans      motions that are drawn before they are run: points, logs
pages      HTTP, WebSockets, what each page receives and may ask for

docs/panel.md describes it and the protocol between page and server.
"""

__version__ = "0.3.0"
