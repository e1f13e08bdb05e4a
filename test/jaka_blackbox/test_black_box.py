"""``jaka_bag record --black-box`` on a real master: each kind of trigger, nothing lost, kept files, kill -9."""
import contextlib
import subprocess
import time

import pytest

pytest.importorskip("rosgraph")

from accidents import (
    KINDS,
    MEASURE,
    NUMBERED,
    Driver,
    account_of,
    black_box,
    call_trigger,
    files_of,
    metadata_of,
    set_off,
)
from live_samples import twist_frame
from ros_graph import Graph, tell_name
from waiting import wait_until

from jaka_bag.operations.signature import verify
from jaka_blackbox.evidence import Evidence


@contextlib.contextmanager
def driving(graph):
    with graph.publisher("/jaka_driver") as publisher:
        driver = Driver(publisher)
        try:
            yield driver
        finally:
            driver.close()


def test_each_kind_of_trigger_writes_a_file_in_which_nothing_is_missing(graph):
    with black_box(graph, before="1s", after="0.2s") as box, driving(graph) as driver:
        assert "at most 256 MB" in box.wait_for_line("keeping the newest 1 s in memory")
        wait_until(lambda: driver.sent > 60, "messages flow")
        for number, kind in enumerate(KINDS):
            set_off(kind, driver, box, graph)
            wait_until(lambda n=number: len(files_of(graph)) > n, "a file of %s" % kind)
    found = {account.triggers[0]["kind"]: account for account in map(account_of, files_of(graph))}
    assert set(found) == set(KINDS)
    for kind, account in found.items():
        assert account.lost == 0, kind
        assert account.before_s > 0.3 and account.after_s > 0.1, kind
        assert [one["kind"] for one in account.triggers] == [kind]
    assert found["expression"].triggers[0]["topic"] == MEASURE.topic
    assert "joint_move called by /cell failed: out of reach" in found["failed_call"].triggers[0]["detail"]
    assert box.output.count("wrote ") >= len(KINDS)


def test_a_description_that_is_set_after_the_model_is_found_soon(graph):
    master = graph.master()
    master.setParam("/jaka_driver/model", "zu7")
    with contextlib.closing(Evidence(graph.uri, "/box", "/jaka_driver", dict)) as evidence:
        evidence.start()
        wait_until(lambda: evidence.facts().get("model") == "zu7", "the parameters are read")
        master.setParam("/robot_description", "<robot/>")
        since = time.monotonic()
        wait_until(lambda: "robot_description.urdf" in [one.name for one in evidence.attachments()], "the description")
        assert time.monotonic() - since < 8.0, "it waited for the next of the slow rounds, 10 s"


def test_after_a_restart_of_the_master_a_new_driver_is_recorded(tmp_path):
    with Graph(tmp_path, True) as graph, black_box(graph, before="5s", after="0.2s") as box:
        box.wait_for_line("in memory")
        address = graph.master().lookupNode("/jaka_black_box")
        graph.stop_master()
        box.wait_for_line("waiting for it")
        graph.start_master()
        tell_name(graph.uri, "/jaka_black_box", address)
        with driving(graph) as driver:
            wait_until(lambda: driver.sent > 60, "messages flow")
            set_off("error", driver, box, graph)
            wait_until(lambda: files_of(graph), "a file")
    assert account_of(files_of(graph)[0]).lost == 0


def test_triggers_that_overlap_extend_one_file(graph):
    with black_box(graph, before="1s", after="1s") as box, driving(graph) as driver:
        wait_until(lambda: driver.sent > 30, "messages flow")
        set_off("error", driver, box, graph)
        first = time.monotonic()
        wait_until(lambda: time.monotonic() > first + 0.5, "half of the time passes")
        set_off("collision", driver, box, graph)
        wait_until(lambda: files_of(graph), "the file")
    (path,) = files_of(graph)
    account = account_of(path)
    assert [one["kind"] for one in account.triggers] == ["error", "collision"]
    assert account.lost == 0 and account.after_s > 0.8
    assert path.name.endswith("_error.mcap")


def test_the_newest_files_are_kept_and_the_memory_is_bounded(graph):
    with black_box(graph, "--keep", "2", "-b", "400k", before="60s", after="0.1s") as box, driving(graph) as driver:
        wait_until(lambda: driver.sent > 450, "more messages than fit")
        for _ in range(4):
            written = box.output.count("wrote ")
            set_off("error", driver, box, graph)
            wait_until(lambda n=written: box.output.count("wrote ") > n, "a file")
    assert len(files_of(graph)) == 2 and box.output.count("removed ") == 2
    for path in files_of(graph):
        account = account_of(path)
        assert account.lost == 0
        before = [m for m in account.messages if m.log_time <= int(account.triggers[0]["time_ns"])]
        assert sum(len(message.data) + 256 for message in before) < 210e3
    assert "fit into memory" in box.output


def test_a_killed_black_box_leaves_a_readable_file_which_the_next_one_makes_whole(graph):
    with black_box(graph, before="5s", after="60s") as box, driving(graph) as driver:
        wait_until(lambda: driver.sent > 100, "messages flow")
        at_trigger = driver.sent
        set_off("emergency_stop", driver, box, graph)
        wait_until(lambda: driver.sent > at_trigger + 190, "more than a second of what follows")
        killed_after, killed_at = driver.sent, driver.sent_at[-1]
        box.popen.kill()
        box.wait()
    (left,) = graph.folder.glob("box/*.mcap.active")
    with black_box(graph, before="5s", after="60s") as box:
        box.wait_for_line("made whole")
    (path,) = files_of(graph)
    assert path.name == left.name[:-len(".active")] and not left.exists()
    account = account_of(path)
    assert account.lost == 0 and account.triggers[0]["kind"] == "emergency_stop"
    assert account.poses[0] == 1 and at_trigger <= account.poses[-1] <= killed_after
    assert driver.sent_at[account.poses[-1] - 1] > killed_at - 1.6  # a chunk is closed at an age of 1 s


def test_the_service_says_the_file_and_sigterm_finishes_and_signs_it(graph):
    subprocess.run(["openssl", "genpkey", "-algorithm", "ed25519", "-out", str(graph.folder / "key.pem")], check=True)
    with black_box(graph, "--sign", "key.pem", after="60s") as box, driving(graph) as driver:
        wait_until(lambda: driver.sent > 20, "messages flow")
        success, name = call_trigger(graph)
        assert success and name.startswith("box/blackbox_") and name.endswith("_service.mcap")
    assert box.stop() == 0
    assert account_of(graph.folder / name).lost == 0
    assert not verify(graph.folder / name).problems
    assert "/jaka_black_box/trigger" not in str(graph.master().getSystemState()[2])


def test_a_latched_message_is_in_each_file_and_losses_are_those_of_its_time(graph):
    with black_box(graph, before="0.5s", after="0.1s") as box, \
            graph.publisher("/jaka_tf") as other, driving(graph) as driver:
        fixed = other.advertise("/tf_static", MEASURE._replace(topic="/tf_static", latching=True), True)
        other.publish(fixed, twist_frame(5), "only")
        wait_until(lambda: other.admit() or fixed.links, "it is taken")
        driver.send(NUMBERED, twist_frame(100000)[4:])  # as if so many had been lost, long before the accident
        begin = driver.sent
        wait_until(lambda: driver.sent > begin + 600, "the loss is past")
        set_off("expression", driver, box, graph)
        wait_until(lambda: files_of(graph), "a file")
    (path,) = files_of(graph)
    account = account_of(path)
    assert [m.data for m in account.messages if m.connection.topic == "/tf_static"] == [twist_frame(5)[4:]]
    assert '"missing": 0' in metadata_of(path, "jaka_bag.drops")[0][NUMBERED]


@pytest.mark.parametrize("arguments, reason", [
    (["--before", "3s"], "--before needs --black-box"), (["--black-box", "b", "-O", "x"], "do not go together"),
    (["--black-box", "b", "--format", "bag"], "writes .mcap"), (["--black-box", "b", "-b", "0"], "limit"),
    (["--black-box", "b", "--trigger", "/a.b >"], "not understood")])
def test_options_that_make_no_sense_are_refused(arguments, reason, capsys, monkeypatch):
    from jaka_bag.cli.main import main
    monkeypatch.setenv("ROS_MASTER_URI", "http://127.0.0.1:1")
    assert main(["record", "-a", *arguments]) == 2
    assert reason in capsys.readouterr().err
