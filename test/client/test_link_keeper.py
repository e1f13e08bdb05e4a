"""A link is connected, and connected anew."""
import threading

from jaka_ros_driver.client.link_keeper import LinkKeeper
from jaka_ros_driver.errors import ConnectionLost


class Peer:
    """Counts connections; refuses as long as it is told to."""

    def __init__(self):
        self.refusals = 0
        self.connected = threading.Semaphore(0)
        self.lost = []
        self.keeper = LinkKeeper("test link", self.connect, self.lost.append)

    def connect(self):
        if self.refusals:
            self.refusals -= 1
            raise ConnectionLost("refused")
        self.connected.release()


def test_connects_after_refusals_and_again_after_each_loss():
    peer = Peer()
    peer.refusals = 3
    peer.keeper.start()
    assert peer.connected.acquire(timeout=10)
    for count in range(1, 4):
        peer.keeper.closed("cut %d" % count)
        assert peer.connected.acquire(timeout=10)
    peer.keeper.stop()
    assert peer.lost == ["cut 1", "cut 2", "cut 3"]
    assert peer.keeper.connections == 4


def test_a_link_that_closes_while_it_connects_is_not_up():
    peer = Peer()
    original = peer.connect
    closes = [True]

    def connect_and_close():
        original()
        if closes:
            closes.pop()
            peer.keeper.closed("closed at once")

    peer.keeper = LinkKeeper("test link", connect_and_close, peer.lost.append)
    peer.keeper.start()
    assert peer.connected.acquire(timeout=10) and peer.connected.acquire(timeout=10)
    peer.keeper.stop()
    assert peer.lost == ["closed at once"]


def test_while_down_it_says_why():
    peer = Peer()
    peer.refusals = 10**6
    assert not peer.keeper.is_up and peer.keeper.last_error == "not connected yet"
    peer.keeper.start()
    waited = threading.Event()
    for _ in range(200):
        if peer.keeper.last_error == "refused":
            break
        waited.wait(0.05)
    assert peer.keeper.last_error == "refused" and not peer.keeper.is_up
    peer.keeper.stop()
