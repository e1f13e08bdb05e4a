"""The type stubs of ROS in tools/stubs/: they say what is there, and mypy finds a wrong type in ``ros/`` by them."""
import os
import subprocess
import sys

import import_graph
import message_stubs

STUBS = message_stubs.STUBS
PACKAGES = sorted(path.name for path in STUBS.iterdir() if path.is_dir())


def run_module(*arguments, folder=import_graph.ROOT, **environment):
    """Return exit code and output of a module of mypy."""
    done = subprocess.run([sys.executable, "-m", *map(str, arguments)], cwd=str(folder), stdout=subprocess.PIPE,
                          stderr=subprocess.STDOUT, text=True, timeout=280,
                          env={**os.environ, "MYPYPATH": "", **environment})
    return done.returncode, done.stdout


def test_the_stubs_of_messages_are_those_of_the_generated_classes():
    made = message_stubs.stubs()
    packages = {path.relative_to(STUBS).parts[0] for path in made}
    assert {"jaka_msgs", "sensor_msgs", "std_srvs"} <= packages
    there = {path: path.read_text() for name in packages for path in (STUBS / name).rglob("*.pyi")}
    assert there == made, "write them anew with test/support/pages/message_stubs.py"


def test_the_stubs_say_what_ros_has():
    code, output = run_module("mypy.stubtest", "--ignore-missing-stub", "--concise", "--allowlist",
                              STUBS / "differences.txt", *PACKAGES, folder=STUBS, MYPYPATH=str(STUBS))
    assert code == 0, output


def test_a_stub_that_says_what_ros_has_not_is_found(tmp_path):
    (tmp_path / "rosgraph").mkdir()
    (tmp_path / "rosgraph" / "__init__.pyi").write_text("def get_master_url() -> str: ...\n")
    code, output = run_module("mypy.stubtest", "--ignore-missing-stub", "--concise", "rosgraph", folder=tmp_path,
                              MYPYPATH=str(tmp_path))
    assert code == 1 and "rosgraph.get_master_url is not present at runtime" in output, output


WRONG = (
    ("topics/speed.py", "publish(Float64(state.rapid_rate))", "publish(state.rapid_rate)",
     'Argument 1 to "publish" of "Publisher" has incompatible type "float"; expected "Float64"'),
    ("convert.py", "message.header.frame_id = parent", "message.header.frame = parent",
     '"Header" has no attribute "frame"; maybe "frame_id"?'),
    ("audit/recorder.py", "self._write(kind, fields, is_urgent)", "self._write(fields, kind)",
     'Argument 1 to "_write" of "Recorder" has incompatible type'),
    ("services/table.py", "RequestDecoder.payload, ServiceHandlers.payload",
     "RequestDecoder.switch, ServiceHandlers.payload", 'expected "Callable[[RequestDecoder, SetPayloadRequest]'),
    ("direct_publisher.py", "rospy.Publisher(name, message_type, queue_size=queue_size, ",
     "rospy.Publisher(name, message_type, ", 'Missing named argument "queue_size" for "Publisher"'),
)
"""A file of ``ros/``, what is there, a wrong text in its place, and the error that mypy reports."""


def test_wrong_types_in_the_node_are_found(tmp_path):
    options = []
    for number, (path, right, wrong, _) in enumerate(WRONG):
        source, changed = import_graph.ROOT / "jaka_ros_driver" / "ros" / path, tmp_path / ("%d.py" % number)
        text = source.read_text()
        assert right in text and len(right) != len(wrong)  # mypy's cache looks at sizes
        changed.write_text(text.replace(right, wrong))
        options += ["--shadow-file", source.relative_to(import_graph.ROOT), changed]
    code, output = run_module("mypy", *options)
    assert code == 1
    for path, _, _, error in WRONG:
        assert [line for line in output.splitlines() if line.startswith("jaka_ros_driver/ros/%s:" % path)
                and error in line], (path, output)
