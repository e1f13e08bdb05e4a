"""The page docs/foxglove.md: its commands as they stand there; its layout against what the driver really publishes."""
import json
import re

import pytest
from foxglove_clients import PATIENCE_S, RawViewer, data_of
from import_graph import ROOT
from page_commands import blocks, until
from waiting import wait_until

from jaka_bag.messages.definitions import parse_definition

PAGE = ROOT / "docs" / "foxglove.md"
LAYOUT = ROOT / "docs" / "foxglove-layout.json"
OPEN = re.compile(r"open ws://localhost:(\d+) in Foxglove")


def port_of(shell, name):
    until(lambda: OPEN.search(shell.said_by(name)), lambda: shell.said_by(name))
    return int(OPEN.search(shell.said_by(name)).group(1))


def panels(node):
    """Return the panels that a layout shows."""
    return [node] if isinstance(node, str) else panels(node["first"]) + panels(node["second"])


def message_paths(layout):
    """Return all message paths of the layout's panels."""
    for config in layout["configById"].values():
        yield from (path["value"] for path in config.get("paths", []))
        yield from (config[name] for name in ("path", "topicPath", "topicToRender") if config.get(name))
        yield from (topic for topic in config.get("topics", {}) if topic.startswith("/"))


def topic_of(path, channels):
    """Return the topic of a message path; None where it is not there."""
    return max((topic for topic in channels if path == topic or path.startswith(topic + ".")), key=len, default=None)


def resolve(path, channels):
    """Follow a message path through the definition of its topic; return the type at its end."""
    topic = topic_of(path, channels)
    assert topic is not None, "%s: no such topic in %s" % (path, sorted(channels))
    name = channels[topic]["schemaName"]
    types = parse_definition(name, channels[topic]["schema"])
    for part in filter(None, path[len(topic):].split(".")):
        field, index = re.fullmatch(r"(\w+)(?:\[(\d+)\])?", part).groups()
        found = {one.name: one for one in types[name].fields}.get(field)
        assert found is not None, "%s: %s has no %s" % (path, name, field)
        assert (found.array is not None) == (index is not None), "%s: %s" % (path, found)
        assert index is None or found.array == -1 or int(index) < found.array
        name = found.type
    return name


def layout_is_shown(layout):
    shown = panels(layout["layout"])
    assert sorted(shown) == sorted(layout["configById"]) and len(set(shown)) == len(shown)
    for name, config in layout["configById"].items():
        for path in config.get("paths", []) if name.startswith("Plot!") else []:
            assert path["timestampMethod"] in ("headerStamp", "receiveTime")
    return True


@pytest.mark.timeout(300)
def test_the_commands_of_the_page_and_the_layout(shell, launch, free_ports, tmp_path):
    commands = {block.note: block.text.strip() for block in blocks(PAGE) if block.language == "sh"}
    arm, viewers, log = (commands["in the background: " + name] for name in ("arm", "viewers", "log"))
    assert arm == "roslaunch jaka_ros_driver display.launch rviz:=false"
    launch("display.launch", "rviz:=false",
           *("%s:=%d" % pair for pair in zip(("command_port", "status_port"), free_ports(2))))
    layout = json.loads(LAYOUT.read_text())
    assert layout_is_shown(layout)

    shell.start("viewers", viewers + " --port 0")
    with RawViewer(port_of(shell, "viewers")) as viewer:
        channels = {}

        def is_complete():
            for channel in viewer.text("advertise")["channels"]:
                channels[channel["topic"]] = channel
            return "/jaka_driver/service_calls" in channels and all(
                topic_of(path, channels) is not None for path in message_paths(layout))
        while not is_complete():
            pass
        for path in message_paths(layout):
            leaf = resolve(path, channels)
            assert leaf in ("float64", "int16") or "Plot" not in path, path
        viewer.subscribe(*[channels[topic]["id"] for topic in ("/jaka_driver/joint_position", "/tf_static", "/tf")
                           if topic in channels])
        seen = set()
        while not {channels["/jaka_driver/joint_position"]["id"], channels["/tf"]["id"]} <= seen:
            seen.add(viewer.until(data_of)[0])
        viewer.send({"op": "getParameters", "parameterNames": ["/robot_description"], "id": "urdf"})
        assert "<robot" in viewer.text("parameterValues")["parameters"][0]["value"]

    code, said = shell.run(next(text for note, text in commands.items() if not note))
    assert code == 0, said
    shell.start("log", log + " --port 0")
    with RawViewer(port_of(shell, "log")) as viewer:
        shown = {channel["topic"]: channel["id"] for channel in viewer.text("advertise")["channels"]}
        viewer.subscribe(shown["/jaka_driver/joint_position"])
        assert viewer.until(data_of)
    wait_until(lambda: "left" in shell.said_by("log"), "it is noticed", PATIENCE_S)
    shell.close()
    assert "Traceback" not in shell.said_by("log") + shell.said_by("viewers")
