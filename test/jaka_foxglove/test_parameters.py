"""Parameters that a viewer asks for: each once, however often and by whatever spelling it is named."""
import asyncio
import json

import pytest

from jaka_foxglove import protocol
from jaka_foxglove.graph_view import GraphView
from jaka_foxglove.outbox import Outbox
from jaka_foxglove.source import ChannelSource
from jaka_foxglove.viewer import TooMuch, Viewer

TREE = {"robot_description": "x" * 100000, "cell": {"number": 7, "deep": {"er": 1}}}


class Master:
    def call(self, *_):
        return TREE


@pytest.fixture
def graph():
    view = GraphView("/test")
    view.close()
    view._master = Master()
    return view


class Source(ChannelSource):
    def __init__(self, graph):
        super().__init__("test")
        self.graph_view = graph

    async def parameters(self, names):
        return self.graph_view.parameters(tuple(names))


@pytest.fixture
def viewer(graph):
    return Viewer("test", Source(graph), "1", 1 << 20, lambda: None, lambda: None)


def answer_to(viewer, op, **message):
    asyncio.run(viewer.serve(viewer.parse(json.dumps({"op": op, **message}))))
    return json.loads(list(iter(viewer.outbox.take, None))[-1])["parameters"]


def test_a_name_is_answered_once_however_often_it_is_asked(viewer, graph):
    assert [one["name"] for one in answer_to(viewer, "getParameters", parameterNames=["/"] * 3000)] == ["/"]
    assert len(graph.parameters(["/" * count for count in range(1, 500)])) == 1
    assert [one.name for one in graph.parameters(["/cell/number", "/cell", "/cell/", "/cell//number", "/none"])] == [
        "/cell/number", "/cell"]
    sent = [{"name": "/cell/number", "value": 1}] * 2000
    assert answer_to(viewer, "setParameters", parameters=sent) == [{"name": "/cell/number", "value": 7}]


def test_who_asks_for_too_many_names_is_disconnected(viewer):
    with pytest.raises(TooMuch, match="more than 10000 parameters"):
        viewer.serve(protocol.GetParameters(tuple("/p%d" % number for number in range(20000)), None))


def test_answers_that_wait_are_bounded_in_bytes():
    outbox, frame = Outbox(1000), "x" * (1 << 20)
    count = 0
    while count < 1000 and outbox.answer(frame):
        count += 1
    assert 8 < count < 100
    while outbox.take() is not None:
        pass
    assert outbox.answer(frame * 100), "one alone may be larger"
    assert not outbox.answer("x")
    assert outbox.take() is not None and outbox.answer("x")
    assert outbox.answer(frame * 100), "what waits is small, whatever comes"
