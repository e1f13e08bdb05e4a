import csv
import io
import json
import math
import os
import struct
import sys

import numpy as np
import pytest
from log_samples import JOINTS, START_NS, STATES, TOOL, Sample, connection, in_order, joints, state_log, text, write

from jaka_bag.cli.main import main
from jaka_bag.containers.registry import open_log
from jaka_bag.errors import BagError, MissingDependency, OutputExists
from jaka_bag.messages.selection import Selection
from jaka_bag.operations.columns import read_columns
from jaka_bag.operations.export import export

SAMPLES = state_log(1.0)


def exported(path, target, **options):
    with open_log(path) as reader:
        return export(reader, target, **options).tables


def rows_of(path):
    return list(csv.DictReader(io.StringIO(path.read_text(encoding="utf-8"))))


def test_csv_gives_each_number_back_exactly(tmp_path):
    path = write(tmp_path / "log.bag", SAMPLES)
    result = exported(path, tmp_path / "run.csv")
    assert sorted(os.listdir(str(tmp_path))) == ["log.bag", "run_jaka_driver_joint_position.csv",
                                                 "run_jaka_driver_robot_states.csv",
                                                 "run_jaka_driver_tool_position.csv", "run_model.csv"]
    assert result[TOOL.topic] == (str(tmp_path / "run_jaka_driver_tool_position.csv"), 125)
    rows = rows_of(tmp_path / "run_jaka_driver_joint_position.csv")
    columns = read_columns(path)[JOINTS.topic]
    assert [[float(row["position[%d]" % i]) for i in range(6)] for row in rows] == columns.fields["position"].tolist()
    assert [int(row["log_time"].replace(".", "")) for row in rows] == columns.log_time.tolist()
    assert [int(row["header.stamp"].replace(".", "")) for row in rows] == columns.fields["header.stamp"].tolist()
    assert rows[0]["name[2]"] == "joint_3" and "velocity[0]" not in rows[0]


def test_one_topic_has_the_name_given_and_odd_values_survive(tmp_path):
    kind = connection("/odd", "a/Odd", "float32 x\nstring s\nbool b\nuint8[] raw\nduration d\nfloat64[] values\n")

    def odd(x, s, raw, seconds, values):
        return (struct.pack("<f", x) + text(s) + b"\x01" + struct.pack("<I", len(raw)) + raw
                + struct.pack("<ii", seconds, 500000000) + struct.pack("<I%dd" % len(values), len(values), *values))

    samples = [Sample(kind, START_NS, odd(0.1, 'a, "b"\nc', b"\xff\x00", -1, [1.5])),
               Sample(kind, START_NS + 1, odd(math.nan, "", b"", 2, [])),
               Sample(kind, START_NS + 2, odd(math.inf, "\u4e2d", b"\x01", 0, [1.0, 2.0]))]
    path = write(tmp_path / "odd.bag", samples)
    exported(path, tmp_path / "odd.csv")
    rows = rows_of(tmp_path / "odd.csv")
    assert [row["x"] for row in rows] == ["0.1", "nan", "inf"]
    assert [row["s"] for row in rows] == ['a, "b"\nc', "", "\u4e2d"]
    assert [row["raw"] for row in rows] == ["ff00", "", "01"]
    assert [row["d"] for row in rows] == ["-0.500000000", "2.500000000", "0.500000000"]
    assert [(row["values[0]"], row["values[1]"]) for row in rows] == [("1.5", ""), ("", ""), ("1.0", "2.0")]
    exported(path, tmp_path / "odd.npz")
    with np.load(str(tmp_path / "odd.npz")) as archive:
        assert archive["odd/values"].tolist() == [1.5, 1.0, 2.0]
        assert archive["odd/values.lengths"].tolist() == [1, 0, 2]


def test_npz_holds_every_topic(tmp_path):
    path = write(tmp_path / "log.mcap", SAMPLES)
    exported(path, tmp_path / "run.npz")
    columns = read_columns(path)
    with np.load(str(tmp_path / "run.npz")) as archive:
        for topic, taken in columns.items():
            assert np.array_equal(archive[topic[1:] + "/log_time"], taken.log_time)
            for name, values in taken.fields.items():
                assert np.array_equal(archive["%s/%s" % (topic[1:], name)], values)


def test_parquet_is_read_by_pyarrow(tmp_path):
    import pyarrow as pa
    from pyarrow import parquet
    path = write(tmp_path / "log.mcap", SAMPLES)
    result = exported(path, tmp_path / "run.parquet", selection=Selection(patterns=[".*position"]))
    table = parquet.read_table(result[JOINTS.topic][0])
    columns = read_columns(path)[JOINTS.topic]
    assert table["position"].to_pylist() == columns.fields["position"].tolist()
    assert table["log_time"].cast(pa.int64()).to_pylist() == columns.log_time.tolist()
    assert table["name"][0].as_py() == ["joint_%d" % i for i in range(1, 7)]
    assert table.schema.field("header.stamp").type == pa.timestamp("ns", "UTC")


@pytest.mark.parametrize("fields", [("log_time", "log_time_"), ("log_time_", "log_time")])
def test_a_field_that_is_called_log_time_has_a_column_of_its_own(tmp_path, fields, recwarn):
    kind = connection("/odd", "a/Odd", "".join("float64 %s\n" % field for field in fields))
    path = write(tmp_path / "odd.bag", [Sample(kind, START_NS, struct.pack("<dd", 1.5, 2.5))])
    values = {"log_time": START_NS, **dict(zip(fields, (1.5, 2.5)))}
    names = dict(zip(fields, ("log_time_", "log_time__")))
    for suffix in (".csv", ".npz", ".parquet"):
        exported(path, tmp_path / ("odd" + suffix))
    (row,) = rows_of(tmp_path / "odd.csv")
    assert row == {"log_time": "%d.%09d" % divmod(START_NS, 10**9), **{names[f]: str(values[f]) for f in fields}}
    with np.load(str(tmp_path / "odd.npz")) as arrays:
        assert {name: arrays[name].tolist() for name in arrays.files} == {
            "odd/log_time": [START_NS], **{"odd/" + names[f]: [values[f]] for f in fields}}
    table = pytest.importorskip("pyarrow.parquet").read_table(str(tmp_path / "odd.parquet"))
    assert {names[f]: table[names[f]].to_pylist() for f in fields} == {names[f]: [values[f]] for f in fields}
    assert table["log_time"].cast("int64").to_pylist() == [START_NS] and not recwarn.list


def test_rows_are_in_the_order_of_time_whatever_their_layout(tmp_path):
    samples = [joints(i, START_NS + (i * 7919) % 500, [float(i)] * (i % 3)) for i in range(200)]
    exported(write(tmp_path / "log.bag", samples, chunk_size=600), tmp_path / "log.csv")
    assert [int(row["header.seq"]) for row in rows_of(tmp_path / "log.csv")] == [
        struct.unpack_from("<I", s.data)[0] for s in in_order(samples)]


def test_refusals(tmp_path, monkeypatch):
    path = write(tmp_path / "log.bag", SAMPLES)
    with pytest.raises(BagError, match=r"\.csv, \.npz, \.parquet"):
        exported(path, tmp_path / "run.xls")
    with pytest.raises(BagError, match="none of the topics"):
        exported(path, tmp_path / "run.csv", selection=Selection(topics=["/nope"]))
    (tmp_path / "run_model.csv").write_text("precious")
    with pytest.raises(OutputExists):
        exported(path, tmp_path / "run.csv")
    assert sorted(os.listdir(str(tmp_path))) == ["log.bag", "run_model.csv"]
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(MissingDependency, match="pyarrow"):
        exported(path, tmp_path / "x.parquet")
    assert sorted(os.listdir(str(tmp_path))) == ["log.bag", "run_model.csv"]


def test_the_program(tmp_path, capsys):
    path = write(tmp_path / "log.bag", SAMPLES)
    assert main(["export", str(path), "-o", str(tmp_path / "s.csv"), "-t", STATES.topic, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["tables"] == [
        {"target": str(tmp_path / "s.csv"), "topic": STATES.topic, "messages": 125}]
    assert main(["export", str(path), "-o", str(tmp_path / "s.csv"), "-t", "/nope"]) == 2
    assert capsys.readouterr().err == "jaka_bag export: error: %s has no topic /nope\n" % path


def on_topic(topic, number):
    return Sample(STATES._replace(topic=topic), START_NS + number, struct.pack("<4h", number, 1, 0, 0))


@pytest.mark.parametrize("suffix", [".csv", ".parquet", ".npz"])
def test_topics_whose_names_meet_are_all_exported(tmp_path, capsys, recwarn, suffix):
    topics = ["/a/b", "/a_b", "/A/b", "chatter", "/chatter", "/caf\udce9"]
    log = write(tmp_path / "log.bag", [on_topic(topic, number) for number, topic in enumerate(topics)])
    assert main(["export", str(log), "-o", str(tmp_path / ("x" + suffix)), "--json"]) == 0
    told = capsys.readouterr()
    assert {t["topic"]: t["messages"] for t in json.loads(told.out)["tables"]} == dict.fromkeys(topics, 1)
    assert "note: chatter is named chatter_2: chatter is another topic's name" in told.err
    assert not recwarn.list
    if suffix == ".npz":
        with np.load(tmp_path / "x.npz") as arrays:
            assert sorted(int(arrays[name][0]) for name in arrays if name.endswith("motion_state")) == list(range(6))
    else:
        assert len({t["target"] for t in json.loads(told.out)["tables"]}) == len(topics)


BROKEN = connection("/broken", "test_msgs/Known", "uint8 v\n")._replace(definition="test_msgs/Missing inner\n")


@pytest.mark.parametrize("suffix", [".csv", ".parquet", ".npz"])
@pytest.mark.parametrize("bad", [Sample(BROKEN, START_NS, b"\1"),
                                 Sample(STATES._replace(topic="/long"), START_NS, bytes(9))])
def test_a_topic_that_is_not_understood_costs_no_other(tmp_path, capsys, suffix, bad):
    log = write(tmp_path / "log.bag", [bad, on_topic("/good", 1), on_topic("/fine", 2)])
    assert main(["export", str(log), "-o", str(tmp_path / ("x" + suffix)), "--json"]) == 1
    told = capsys.readouterr()
    assert [t["topic"] for t in json.loads(told.out)["tables"] if t["messages"] == 1] == ["/fine", "/good"]
    assert "error: %s is left out: " % bad.connection.topic in told.err
    assert not [path for path in tmp_path.iterdir() if "broken" in path.name or "long" in path.name]
    assert main(["cat", str(log)]) == 1
    told = capsys.readouterr()
    assert [json.loads(line)["topic"] for line in told.out.splitlines()] == ["/good", "/fine"]
    assert "left out: " in told.err and bad.connection.topic in told.err
