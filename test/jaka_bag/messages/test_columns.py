"""Columns of messages: one long text costs what it is long, and no text loses what is in it."""
import struct
import tracemalloc

import numpy as np
import pytest
from log_samples import BREAK, START_NS, Sample, connection, text, write

from jaka_bag.containers.registry import open_log
from jaka_bag.messages.batch import are_rows_equal, columns_at, largest, row_products
from jaka_bag.messages.selection import Selection
from jaka_bag.operations.columns import read_columns
from jaka_bag.operations.export import export

LOG = connection("/log", "std_msgs/String", "string data\n")
WORDS = connection("/log", "cell/Words", "string[] data\n")
LONG = "x" * 300000
BOUND = 150 << 20
"""Byte: far above what the messages need, far below one width for all of them, 6 GB."""


def with_one_long_text(path, count=20000):
    return write(path, [Sample(LOG, START_NS + i, text(LONG if i == count // 2 else "line %d" % i))
                        for i in range(count)])


def peak_of(function, *arguments):
    tracemalloc.start()
    try:
        function(*arguments)
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


def exported(log, target):
    with open_log(log) as reader:
        return export(reader, target, Selection())


def test_one_long_text_does_not_widen_all_others(tmp_path):
    log = with_one_long_text(tmp_path / "log.mcap")
    assert peak_of(read_columns, log) < BOUND
    column = read_columns(log)[LOG.topic].fields["data"]
    assert column.shape == (20000,) and bytes(column[7]) == b"line 7" and len(column[10000]) == len(LONG)


def test_one_long_text_is_exported_to_parquet_in_bounded_memory(tmp_path):
    parquet = pytest.importorskip("pyarrow.parquet")
    log = with_one_long_text(tmp_path / "log.mcap")
    assert peak_of(exported, log, tmp_path / "log.parquet") < BOUND
    texts = parquet.read_table(str(tmp_path / "log.parquet"))["data"].to_pylist()
    assert texts[7] == "line 7" and texts[10000] == LONG and len(texts) == 20000


def test_one_long_text_is_exported_to_arrays_in_bounded_memory(tmp_path):
    log = with_one_long_text(tmp_path / "log.mcap")
    assert peak_of(exported, log, tmp_path / "log.npz") < BOUND
    with np.load(str(tmp_path / "log.npz"), allow_pickle=False) as arrays:
        data, lengths = arrays["log/data"], arrays["log/data.lengths"]
    assert data.dtype == np.uint8 and lengths.sum() == len(data) and lengths[10000] == len(LONG)
    start = lengths[:7].sum()
    assert data[start:start + lengths[7]].tobytes() == b"line 7"


def test_zeros_at_the_end_of_a_text_are_kept(tmp_path):
    words = ["E100\0\0", "E100", "\0", ""]
    log = write(tmp_path / "log.bag", [Sample(LOG, START_NS + i, text(word)) for i, word in enumerate(words)])
    assert list(map(bytes, read_columns(log)[LOG.topic].fields["data"])) == [word.encode() for word in words]
    exported(log, tmp_path / "log.csv")
    with open(str(tmp_path / "log.csv"), encoding="utf-8", newline="") as lines:
        assert [line.rstrip("\r\n").split(",")[1].strip('"') for line in lines][1:] == words
    exported(log, tmp_path / "log.npz")
    with np.load(str(tmp_path / "log.npz"), allow_pickle=False) as arrays:
        assert arrays["log/data"].tobytes() == "".join(words).encode()
        assert arrays["log/data.lengths"].tolist() == list(map(len, words))
    parquet = pytest.importorskip("pyarrow.parquet")
    exported(log, tmp_path / "log.parquet")
    assert parquet.read_table(str(tmp_path / "log.parquet"))["data"].to_pylist() == words


def test_zeros_at_the_end_of_a_text_in_an_array_are_kept(tmp_path):
    rows = [["E100\0\0", "a"], ["E100", "b"], ["E100", "\0"], [], ["c"]]
    log = write(tmp_path / "log.mcap", [Sample(WORDS, START_NS + i, struct.pack("<I", len(row)) + b"".join(
        map(text, row))) for i, row in enumerate(rows)])
    column = read_columns(log)[WORDS.topic].fields["data"]
    assert [list(map(bytes, row)) for row in column] == [[word.encode() for word in row] for row in rows]
    exported(log, tmp_path / "log.csv")
    with open(str(tmp_path / "log.csv"), encoding="utf-8", newline="") as lines:
        found = [[cell.strip('"') for cell in line.rstrip("\r\n").split(",")[1:]] for line in lines]  # 3.8 quotes a NUL
    assert found[1:] == [row + [""] * (2 - len(row)) for row in rows]
    exported(log, tmp_path / "log.npz")
    words = [word for row in rows for word in row]
    with np.load(str(tmp_path / "log.npz"), allow_pickle=False) as arrays:
        assert arrays["log/data"].tobytes() == "".join(words).encode()
        assert arrays["log/data.sizes"].tolist() == list(map(len, words))
        assert arrays["log/data.lengths"].tolist() == list(map(len, rows))
    parquet = pytest.importorskip("pyarrow.parquet")
    exported(log, tmp_path / "log.parquet")
    assert parquet.read_table(str(tmp_path / "log.parquet"))["data"].to_pylist() == rows


def test_an_array_of_messages_without_fields_is_a_column_of_their_number(tmp_path):
    kind = connection("/log", "cell/Signals", "Nothing[] some\nNothing[2] two\nint8 last\n" + BREAK
                      + "MSG: cell/Nothing\n")
    log = write(tmp_path / "log.mcap", [Sample(kind, START_NS + i, struct.pack("<Ib", count, 7))
                                        for i, count in enumerate((2, 0, 5))])
    fields = read_columns(log)[kind.topic].fields
    assert sorted(fields) == ["last", "some"] and fields["some"].tolist() == [2, 0, 5]


def test_parts_of_rows_of_several_matrices_are_joined():
    matrices = [np.arange(60, dtype=np.uint8).reshape(6, 10), np.arange(100, 120, dtype=np.uint8).reshape(2, 10)]
    for begin, width in ((0, 10), (3, 1), (7, 3)):
        expected = np.concatenate(matrices)[:, begin:begin + width]
        assert (columns_at(matrices, begin, width) == expected).all()
        assert (columns_at(matrices[:1], begin, width) == expected[:6]).all()


def test_rows_of_equal_bytes_are_told_from_others():
    names = np.array([[b"a", b"bc"]] * 5)
    assert are_rows_equal(names) and are_rows_equal(names[:1]) and are_rows_equal(names[:0])
    assert are_rows_equal(np.zeros((5, 0), "S1"))
    for row in range(5):
        other = names.copy()
        other[row, 1] = b"bd"
        assert not are_rows_equal(other)


def test_the_largest_of_each_row_is_that_of_numpy():
    values = np.array([[1.0, 3.0, -2.0], [np.nan, 1.0, 2.0], [-1.0, -5.0, -np.inf], [2.0, 0.0, np.inf]])
    assert np.array_equal(largest(values), values.max(axis=1), equal_nan=True)


@pytest.mark.parametrize("shape", [(5, 1), (0, 3), (400, 6), (20, 30, 6)])
def test_products_of_rows_are_those_of_numpy(shape):
    some, others = np.random.RandomState(1).normal(size=(2, *shape))
    assert np.array_equal(row_products(some, others), (some * others).sum(axis=-1))
    assert np.array_equal(row_products(some, others[:1]), (some * others[:1]).sum(axis=-1))
