"""The kinds of cut of the running node's links: noticed, survived, nothing replayed; a soak test does more."""
import pytest
from driver_bench import LiveDriver
from link_cuts import CUTS, LinkWatch, size_of

SEED = 20260727


@pytest.fixture
def live(ros_node, tmp_path):
    with LiveDriver(tmp_path, name="linked", simulator=("--single-client", "replace"), guard=False) as running:
        running.arm.wait_until_ready()
        yield running


def test_every_cut_is_noticed_and_survived_and_nothing_is_sent_twice(live):
    watch = LinkWatch(live, SEED)
    try:
        for name in watch.chance.sample(sorted(CUTS), len(CUTS)):
            watch.cut(name)
        watch.assert_topics_were_sane()
    finally:
        watch.close()
    assert all(outcome.noticed < 6.0 and outcome.usable < 8.0 for outcome in watch.outcomes), watch.outcomes
    code, said = live.end_driver()
    assert code == 0 and "Traceback" not in said, said
    watch.judge(live.verdict())


def test_reconnects_leave_nothing_behind(live):
    watch = LinkWatch(live, SEED)
    sizes = []
    try:
        for port in ["command", "status", "status", "all"] + ["status"] * 4 + ["command", "status", "status", "all"]:
            watch.reconnect(port)
            sizes.append(size_of(live.process.pid))
    finally:
        watch.close()
    assert max(size.threads for size in sizes[-4:]) <= max(size.threads for size in sizes[:4]) + 1
    assert max(size.descriptors for size in sizes[-4:]) <= max(size.descriptors for size in sizes[:4]) + 2
