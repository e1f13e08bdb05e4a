"""The part of rospy's transport that a connection of a direct publisher uses, over any socket."""


class LinkTransport:
    """A transport that has sent nothing yet."""

    def __init__(self, sock):
        self.socket = sock
        self.stat_bytes = self.stat_num_msg = 0
        self.endpoint_id = "/listener"

    def close(self):
        if self.socket is not None:
            self.socket.close()
        self.socket = None
