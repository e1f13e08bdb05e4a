"""``jaka_bag dataset query``: the command line that asks a data set."""
import argparse
import importlib
import json
import sys
from typing import Any, Iterator, List, Optional

from jaka_bag.cli.main import printable
from jaka_bag.errors import UsageError
from jaka_bag.operations.parquet import load_pyarrow
from jaka_bag.output_file import OutputFile, check_output

from ..dataset.query import DataSet

_MOST_ROWS = 200
"""Most rows of a table on a terminal; files get all."""
_WIDEST = 60
"""Most characters of a cell on a terminal."""

EPILOG = """\
The tables are runs (a row a log) and the topics, /jaka_driver/robot_states as jaka_driver_robot_states or, where no
other topic ends so, robot_states; each with cell, run, date and the columns of export. Names with a dot stand in
quotes: "header.stamp". Times are UTC. docs/fleet.md has questions to begin with.

examples:
  jaka_bag dataset query fleet "SELECT cell, count(*), sum(duration) FROM runs GROUP BY cell"
  jaka_bag dataset query fleet "SELECT * FROM runs WHERE status <> 'whole'" --csv damaged.csv
  jaka_bag dataset query fleet "DESCRIBE robot_states"
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of ``jaka_bag dataset query``."""
    parser.add_argument("dataset", metavar="DATASET", help="a folder or URL that dataset add made")
    parser.add_argument("question", metavar="SQL", nargs="?",
                        help="as DuckDB understands it; without it: the tables that there are")
    group = parser.add_argument_group("the answer (default: a table, at most %d rows of it)" % _MOST_ROWS)
    group.add_argument("--csv", metavar="FILE", help="as CSV, all rows; - for standard output")
    group.add_argument("--parquet", metavar="FILE", help="as Parquet, all rows")
    group.add_argument("-f", "--force", action="store_true", help="overwrite the file")


def _text(value: Any) -> str:
    if value is None:
        return ""
    if isinstance(value, float):
        return "%.6g" % value
    return printable(str(value).replace("\n", " "))


def _texts(pa: Any, column: Any) -> List[str]:
    """Return the cells of a column as text; times as ISO 8601, which needs no time zones' data base."""
    if pa.types.is_timestamp(column.type):
        column = column.cast(pa.timestamp(column.type.unit)).cast(pa.string())
    elif pa.types.is_duration(column.type) or pa.types.is_interval(column.type):
        return [_text(value) for value in column.to_pylist()]
    return [_text(value) for value in column.to_pylist()]


def _show(pa: Any, schema: Any, batches: Iterator[Any]) -> None:
    columns: List[List[str]] = [[name] for name in schema.names]
    has_more = False
    for batch in batches:
        room = _MOST_ROWS + 1 - len(columns[0])
        has_more |= len(batch) > room
        for cells, column in zip(columns, batch.slice(0, room).columns):
            cells += _texts(pa, column)
        if has_more:
            break
    is_number = [pa.types.is_integer(kind) or pa.types.is_floating(kind) for kind in schema.types]
    widths = [min(max(map(len, cells)), _WIDEST) for cells in columns]
    for number, row in enumerate(zip(*columns)):
        print("  ".join((cell.rjust if right else cell.ljust)(width) for cell, width, right in zip(
            row, widths, is_number)).rstrip())
        if not number:
            print("  ".join("-" * width for width in widths))
    if has_more:
        print("... and more: --csv or --parquet gives all rows")


def _write_csv(pa: Any, file: Any, schema: Any, batches: Iterator[Any]) -> None:
    """Write an answer as CSV; lists and structures, which CSV has no place for, as JSON."""
    csv = importlib.import_module("pyarrow.csv")

    def is_plain(field: Any) -> bool:
        try:
            with csv.CSVWriter(pa.BufferOutputStream(), pa.schema([field])) as writer:
                writer.write_batch(pa.RecordBatch.from_arrays([pa.nulls(1, field.type)], schema=pa.schema([field])))
        except (pa.ArrowInvalid, pa.ArrowNotImplementedError):
            return False
        return True

    plain = [is_plain(field) for field in schema]
    fields = [field if good else pa.field(field.name, pa.string()) for field, good in zip(schema, plain)]
    with csv.CSVWriter(pa.PythonFile(file, mode="w"), pa.schema(fields)) as writer:
        for batch in batches:
            columns = [column if good else pa.array(map(_csv_text, column.to_pylist()), pa.string())
                       for column, good in zip(batch.columns, plain)]
            writer.write_batch(pa.RecordBatch.from_arrays(columns, schema=pa.schema(fields)))


def _csv_text(value: Any) -> Optional[str]:
    if value is None or isinstance(value, str):
        return value
    return json.dumps(value, default=str) if isinstance(value, (dict, list)) else str(value)


def _write(args: argparse.Namespace, schema: Any, batches: Iterator[Any]) -> None:
    pa, parquet = load_pyarrow()
    if args.csv == "-":
        sys.stdout.flush()
        _write_csv(pa, sys.stdout.buffer, schema, batches)
        return
    if args.csv is not None:
        with OutputFile(args.csv, args.force) as output:
            _write_csv(pa, output.file, schema, batches)
        return
    with OutputFile(args.parquet, args.force) as output, parquet.ParquetWriter(
            pa.PythonFile(output.file, mode="w"), schema, compression="zstd") as writer:
        for batch in batches:
            writer.write_batch(batch)


def run(args: argparse.Namespace) -> int:
    """Ask the data set and print the rows; return the exit code."""
    if args.csv is not None and args.parquet is not None:
        raise UsageError("--csv and --parquet do not go together")
    for path in (args.csv, args.parquet):
        if path not in (None, "-"):
            check_output(path, args.force)
    pa, _ = load_pyarrow()
    with DataSet(args.dataset) as data:
        for note in data.notes(args.question):
            print("jaka_bag: note: %s" % printable(note), file=sys.stderr)
        if args.question is None:
            print("runs")
            for name, topic in sorted(data.views.items()):
                print("%-40s %s" % (name, printable(topic)))
            return 0
        schema, batches = data.ask(args.question)
        if args.csv is None and args.parquet is None:
            _show(pa, schema, batches)
        else:
            _write(args, schema, batches)
    return 0
