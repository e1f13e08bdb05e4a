"""HTTP and WebSockets: what each page receives and may ask for. One event loop; what waits runs in threads.

access          who may ask: Host, Origin, headers, the token
files           the page's own files, and those of the arms' meshes
simulator_link  the simulated controller's operator port
arm_desk        all that belongs to one arm
hub             arms and pages: states to the pages, control, the stop
commands        what a page may ask for beside jog and stop
session         one page: its messages out, what it watches and moves
websocket_session  the WebSocket session of a page, from hello to the end
server          addresses, and the end
"""
