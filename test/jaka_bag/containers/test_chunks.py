"""The fast way to read a chunk and the exact one give the same, whatever the chunk."""
import struct

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from log_samples import MODEL, STATES, message_record, payload

from jaka_bag.containers.bag import reader as bag_chunk
from jaka_bag.containers.bag import records as bag_format
from jaka_bag.containers.mcap import reader as mcap_chunk
from jaka_bag.containers.mcap import records as mcap_format
from jaka_bag.containers.mcap import writer as mcap_records
from jaka_bag.errors import BagFormatError

CONNECTIONS = st.sampled_from([0, 1, 7, 65535, 65536, 0xFFFFFFFF])
TIMES = st.integers(0, 0xFFFFFFFF * 10**9 + 999999999)
PAYLOADS = st.one_of(st.binary(max_size=40), st.sampled_from([b"", b"x" * 8, b"y" * 73]))
BAG_ITEMS = st.lists(st.one_of(
    st.tuples(st.just("message"), CONNECTIONS, TIMES, PAYLOADS),
    st.tuples(st.just("connection"), CONNECTIONS),
), max_size=60)


def content(block):
    return [(int(block.connection[i]), int(block.log_time[i]), payload(block, i), int(block.publish_time[i]),
             int(block.sequence[i])) for i in range(len(block))]


@given(BAG_ITEMS, st.permutations([0, 1, 2]), st.integers(0, 20), st.sampled_from(
    ["right", "none", "lacks one", "points at a connection", "points nowhere", "doubles one"]), st.data())
def test_a_bag_chunk_is_read_alike_fast_and_exact(items, order, odd_one, index_kind, data):
    raw = b""
    offsets, others, truth, declared = [], [], [], {}
    for i, item in enumerate(items):
        if item[0] == "message":
            offsets.append(len(raw))
            irregular = i == odd_one and data.draw(st.booleans())
            raw += message_record(item[1], item[2], item[3], order[::-1] if irregular else order,
                                  [("x", b"y")] if irregular else [])
            truth.append((item[1], item[2], item[3], item[2], 0))
        else:
            others.append(len(raw))
            raw += bag_format.connection_record(item[1], MODEL)
            declared[item[1]] = MODEL
    if index_kind == "lacks one":
        offsets = offsets[1:]
    elif index_kind == "points at a connection":
        offsets = sorted(offsets + others[:1])
    elif index_kind == "points nowhere":
        offsets = sorted(offsets + [len(raw) // 2])
    elif index_kind == "doubles one":
        offsets = sorted(offsets + offsets[:1])
    index = None if index_kind == "none" else np.array(offsets, np.int64)
    parsed = bag_chunk.parse_chunk(raw, index)
    assert content(parsed.batch) == truth
    assert parsed.connections == declared
    assert content(bag_chunk.scan(raw).batch) == truth


MCAP_ITEMS = st.lists(st.one_of(
    st.tuples(st.just("message"), st.integers(0, 65535), st.integers(0, 2**63 - 1), PAYLOADS,
              st.integers(0, 2**32 - 1), st.integers(0, 2**63 - 1)),
    st.tuples(st.just("channel"), st.integers(0, 65535)),
    st.tuples(st.just("unknown"), st.binary(max_size=9)),
), max_size=60)


@given(MCAP_ITEMS, st.sampled_from(["right", "none", "lacks one", "points elsewhere"]))
def test_an_mcap_chunk_is_read_alike_fast_and_exact(items, index_kind):
    raw = b""
    offsets, others, truth, declared = [], [], [], set()
    for item in items:
        if item[0] == "message":
            _, channel, time, payload, sequence, publish_time = item
            offsets.append(len(raw))
            raw += mcap_format.MESSAGE_HEAD.pack(mcap_format.MESSAGE, 22 + len(payload), channel, sequence, time,
                                                 publish_time) + payload
            truth.append((channel, time, payload, publish_time, sequence))
        elif item[0] == "channel":
            others.append(len(raw))
            raw += mcap_records.schema_record(1, STATES) + mcap_records.channel_record(item[1], 1, STATES)
            declared.add(item[1])
        else:
            raw += mcap_records.record(0x90, item[1])
    if index_kind == "lacks one":
        offsets = offsets[1:]
    elif index_kind == "points elsewhere":
        offsets = sorted(offsets + others[:1])
    index = None if index_kind == "none" else np.array(offsets, np.int64)
    parsed = mcap_chunk.parse_chunk(raw, index, mcap_chunk.Channels())
    assert content(parsed.batch) == truth
    assert set(parsed.connections) == declared
    assert all(c.datatype == STATES.datatype and c.md5sum == STATES.md5sum for c in parsed.connections.values())


@pytest.mark.parametrize("cut", [1, 5, 30, 46, 50])
def test_a_chunk_that_ends_inside_a_record_is_damaged(cut):
    raw = message_record(0, 5, b"12345678") * 2
    broken = raw[:len(raw) - cut]
    with pytest.raises(BagFormatError):
        bag_chunk.parse_chunk(broken, np.array([0, len(raw) // 2]))
    assert bag_chunk.scan(broken).consumed == len(raw) // 2
    assert len(bag_chunk.scan(broken).batch) == 1


def test_a_damaged_record_in_an_mcap_chunk_is_an_error():
    good = mcap_format.MESSAGE_HEAD.pack(mcap_format.MESSAGE, 22, 1, 0, 5, 5)
    for bad in (good[:-1], struct.pack("<BQ", mcap_format.MESSAGE, 3) + b"abc", bytes(40)):
        with pytest.raises(BagFormatError):
            mcap_chunk.parse_chunk(good + bad, None, mcap_chunk.Channels())
        assert len(mcap_chunk.scan(good + bad, mcap_chunk.Channels()).batch) == 1
