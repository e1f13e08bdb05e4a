"""Names resolved by the rules of ROS (ROS wiki "Names")."""
import pytest

from jaka_bag.errors import BagError
from jaka_bag.live.names import NodeNames, anonymous_name, host_address, node_names, split_remappings


def test_words_with_a_sign_are_remappings():
    assert split_remappings(["/a", "x:=y", "__name:=z", ":=q", "b:="]) == (
        ["/a", ":=q", "b:="], {"x": "y", "__name": "z"})


@pytest.mark.parametrize("name, resolved", [
    ("bar", "/wg/bar"), ("/bar", "/bar"), ("~bar", "/wg/node/bar"), ("bar/", "/wg/bar"), ("/a//b", "/a/b")])
def test_names_resolve_as_the_wiki_says(name, resolved):
    assert NodeNames("/wg/node", "/wg").resolve(name) == resolved


def test_remappings_work_on_resolved_names():
    names = node_names("base", {"__name": "rec", "__ns": "left", "tool": "/right/tool", "_rate": "3"}, {})
    assert (names.node, names.namespace) == ("/left/rec", "/left")
    assert names.resolve("tool") == names.resolve("/left/tool") == "/right/tool"
    assert names.resolve("other") == "/left/other"


def test_the_environment_gives_the_namespace_unless_the_command_line_does():
    assert node_names("base", {}, {"ROS_NAMESPACE": "/env"}).node == "/env/base"
    assert node_names("base", {"__ns": "/line"}, {"ROS_NAMESPACE": "/env"}).node == "/line/base"


@pytest.mark.parametrize("name", ["", "1a", "a b", "a-b", "a.b"])
def test_illegal_names_are_refused(name):
    with pytest.raises(BagError, match="not a legal ROS name"):
        NodeNames("/n").resolve(name)


def test_illegal_node_names_are_refused():
    with pytest.raises(BagError, match="not a legal node name"):
        node_names("base", {"__name": "a/b"}, {})


def test_anonymous_names_differ_and_are_legal():
    first, second = anonymous_name("rec"), anonymous_name("rec")
    assert first != second
    assert NodeNames("/n").resolve(first) == "/" + first


@pytest.mark.parametrize("environment, host, bind", [
    ({"ROS_HOSTNAME": "arm", "ROS_IP": "10.0.0.1"}, "arm", ""), ({"ROS_IP": "10.0.0.1"}, "10.0.0.1", ""),
    ({"ROS_IP": "127.0.0.1"}, "127.0.0.1", "127.0.0.1"), ({"ROS_HOSTNAME": "localhost"}, "localhost", "127.0.0.1")])
def test_a_local_host_listens_locally(environment, host, bind):
    assert host_address(environment) == (host, bind)


def test_without_settings_the_host_has_its_name():
    assert host_address({})[0]
