"""Servers for Foxglove and Lichtblick: a running ROS graph, or logs with a play bar. On top of ``jaka_bag``.

protocol         the Foxglove WebSocket protocol: bytes and text on one side, values on the other; pure
outbox           what waits for one viewer: bounded, the newest messages win
access           who may connect: Origin and Host
source           the interfaces between viewers and the source that they see
viewer           one viewer: its subscriptions and what it asks
server           the WebSocket server, on aiohttp
live_topics      a running graph as a source
graph_view       parameters and the graph, and what has changed in them
service_calls    services of the graph, called for viewers where the user allows it
log_playback     logs as a source
playback_clock   where a playback stands; pure
cli              the command lines: ``jaka_foxglove``, ``jaka_bag serve``
"""
