"""HTTP and WebSockets: what each page receives and may ask for. What waits runs in threads.

Two event loops, each with its thread: the hub's, of arms, stop and jog and of connections with the token; and the
door's, of everybody else.

door            the listener, and which loop a connection belongs to
tls             the TLS of a connection, which goes from one loop to another
peer            what a connection may send, below requests and messages
log_limit       how many log lines peers can cause
access          who may ask: Host, Origin, headers, the token
files           the page's own files, and those of the arms' meshes
simulator_link  the simulated controller's operator port
arm_session     the session with one arm's driver: all that belongs to it
hub             arms and pages: states to the pages, control, the stop
commands        what a page may ask for beside jog and stop
shared_cell     the data of the cell: to all pages, and changes of them
teaching        the present pose, frames and tools from poses
session         one page: its messages out, what it watches and moves
websocket_session  the WebSocket session of a page, from hello to the end
server          addresses, for the connections of one loop
"""
