"""The joints of a log that are replayed, and the defects of those that are not."""
import numpy as np
import pytest
from log_samples import START_NS, joints, model, write
from motion_logs import JOINTS, led, log_of, recording_of, session

from jaka_bag.compare.runs.loading import load_run
from jaka_bag.errors import BagError, UsageError
from jaka_regression.motion.recorded import recorded_joints


def wrong(path, words, *sessions, **options):
    with pytest.raises(BagError, match=words):
        recording_of(path, *sessions, **options)


@pytest.mark.parametrize("suffix", [".bag", ".mcap"])
def test_the_joints_are_read_from_both_formats(tmp_path, suffix):
    recording = recording_of(tmp_path / ("log" + suffix), session())
    assert recording.names == tuple(JOINTS) and recording.node == "/jaka_driver"
    assert np.abs(recording.position - led(recording.time - 1.5)).max() < 2e-3
    assert (np.diff(recording.time) > 0.0).all() and abs(recording.interval - 0.008) < 1e-4


def test_samples_that_were_held_up_are_put_where_they_were_measured(tmp_path):
    punctual, held = session(), session()
    for first in range(200, 700, 50):  # half a dozen samples come at once, with the last of them
        held.stamp[first:first + 6] = held.stamp[first + 6] - 1e-5 * np.arange(6, 0, -1)
    recording = recording_of(tmp_path / "held.mcap", held)
    plain = recording_of(tmp_path / "plain.mcap", punctual)
    truth = led(recording.time - 1.5 - np.median(recording.time[:100] - held.time[:100]))
    assert np.abs(recording.position - truth).max() < 1.5e-3
    assert len(recording.time) > 0.9 * len(plain.time)


def test_nan_is_left_out_and_nothing_but_nan_is_refused(tmp_path):
    some = session()
    some.joints[300:310, 2] = np.nan
    recording = recording_of(tmp_path / "some.mcap", some)
    assert np.isfinite(recording.position).all() and len(recording.time) <= len(some.time) - 10
    some.joints[:] = np.nan
    wrong(tmp_path / "all.mcap", "has no sample of six numbers", some)


def test_a_long_silence_in_a_motion_is_refused_and_one_at_rest_is_none(tmp_path):
    gap = session()
    gap.keep["joint_position"][400:450] = False
    wrong(tmp_path / "gap.mcap", r"for 0\.41 s from 3\.1\d+ s on there is no sample .* rad farther", gap)
    assert len(recording_of(tmp_path / "gap2.mcap", gap, longest_gap=0.5).time)
    rest = session()
    rest.keep["joint_position"][20:120] = False
    assert len(recording_of(tmp_path / "rest.mcap", rest).time)


def test_a_jump_of_two_recordings_is_refused_and_a_part_is_taken(tmp_path):
    merged = session()
    merged.joints[450:] += 0.5
    wrong(tmp_path / "merged.mcap", r"joint_\d of /jaka_driver/joint_position jumps from .* two recordings", merged)
    run = load_run(tmp_path / "merged.mcap")
    part = recorded_joints(run, None, None, run.start_ns + 3_000_000_000)
    assert part.time[-1] <= 3.0
    with pytest.raises(BagError, match="no sample of six numbers in the part"):
        recorded_joints(run, None, run.start_ns + 60_000_000_000)


def test_too_short_and_empty_logs_are_refused(tmp_path):
    few = session()
    few.keep["joint_position"][5:] = False
    wrong(tmp_path / "few.mcap", "too short to replay: 5 samples", few)
    with pytest.raises(BagError, match="has no messages"):
        load_run(write(tmp_path / "empty.mcap", []))
    with pytest.raises(BagError, match="holds no joint positions"):
        recorded_joints(load_run(write(tmp_path / "text.mcap", [model(START_NS, "zu7")])))


def test_several_arms_need_a_topic(tmp_path):
    left, right = session(), session(seed=2)
    left.node, right.node = "/left/jaka_driver", "/right/jaka_driver"
    run = load_run(log_of(tmp_path / "two.mcap", left, right))
    with pytest.raises(UsageError, match="--topic: /left/jaka_driver/joint_position, /right"):
        recorded_joints(run)
    assert recorded_joints(run, "/right/jaka_driver/joint_position").node == "/right/jaka_driver"
    with pytest.raises(BagError, match="no joint positions on /middle"):
        recorded_joints(run, "/middle")


def test_joints_come_in_any_order_with_a_prefix_and_others_are_refused(tmp_path):
    names, values = ["left_joint_%d" % n for n in (6, 1, 2, 3, 4, 5)], [0.6, 0.1, 0.2, 0.3, 0.4, 0.5]
    samples = [joints(n, START_NS + n * 8_000_000, values, names) for n in range(20)]
    recording = recorded_joints(load_run(write(tmp_path / "order.mcap", samples)))
    assert recording.position[0] == pytest.approx([0.1, 0.2, 0.3, 0.4, 0.5, 0.6])
    samples = [joints(n, START_NS + n * 8_000_000, values + [0.7]) for n in range(20)]
    with pytest.raises(BagError, match="the joints on .* joint_7; those of an arm are joint_1"):
        recorded_joints(load_run(write(tmp_path / "seven.mcap", samples)))
