"""``jaka_bag info``: the content of a log, from its index alone; imports no numpy unless --freq asks for it."""
import time
from typing import TYPE_CHECKING, Any, Dict, Iterable, List, Optional, Sequence, Tuple

from ..containers.index import LogIndex, is_rosbag2
from ..containers.registry import read_codecs, read_index
from ..errors import BagFormatError, UsageError
from ..log_records import ACCIDENT, DROPS, TRIGGER
from .main import for_each_file, human_bytes, printable

if TYPE_CHECKING:
    import argparse

_LOSSES = (("missing", "missing by header.seq"), ("undelivered", "sent but not received"),
           ("overflowed", "thrown away at a full buffer"), ("unwritten", "not written"))


EPILOG = """\
examples:
  jaka_bag info run.bag
  jaka_bag info --freq --seq run.mcap
  jaka_bag info -k duration run_*.bag

Exit code: 0 done, 1 a file could not be read (the others are shown), 2 usage.
"""


def add_arguments(parser: "argparse.ArgumentParser") -> None:
    """Add the options of ``jaka_bag info`` to a parser."""
    parser.add_argument("files", nargs="+", metavar="FILE",
                        help=".bag, .mcap, .mcap.active, .db3, recognised by content; a rosbag2 folder")
    parser.add_argument("--freq", action="store_true",
                        help="per topic rate, jitter, largest gap and missing messages, from the index's times")
    parser.add_argument("--seq", action="store_true",
                        help="per topic gaps in header.seq: what was lost before it was recorded (reads all messages)")
    parser.add_argument("-k", "--key", metavar="KEY", help="print one value of the JSON document, as messages")
    parser.add_argument("-y", "--yaml", action="store_true", help="everything as YAML")
    parser.add_argument("--json", action="store_true", help="everything as JSON")


def _topics(index: LogIndex) -> List[Dict[str, Any]]:
    topics: Dict[str, Dict[str, Any]] = {}
    for number, connection in enumerate(index.connections):
        entry = topics.setdefault(connection.topic, {
            "topic": connection.topic, "type": connection.datatype, "md5sum": connection.md5sum, "messages": 0,
            "connections": 0, "latching": False, "callers": []})
        entry["messages"] += index.counts[number]
        entry["connections"] += 1
        entry["latching"] = entry["latching"] or bool(connection.latching)
        if connection.callerid is not None and connection.callerid not in entry["callers"]:
            entry["callers"].append(connection.callerid)
    return [topics[name] for name in sorted(topics)]


def _codecs(codecs: Iterable[Tuple[str, int, int, int]]) -> List[Dict[str, Any]]:
    return [{"codec": codec, "chunks": chunks, "stored": stored, "uncompressed": full}
            for codec, chunks, stored, full in codecs]


def document_of(index: LogIndex) -> Dict[str, Any]:
    """Return the facts of a log's index as JSON data; times and durations in s, ``*_ns`` in ns."""
    start, end = index.start_time, index.end_time
    types = {(c.datatype, c.md5sum): None for c in index.connections}
    return {
        "path": index.path, "format": index.format, "version": index.version, "profile": index.profile,
        "library": index.library, "size": index.size, "start_ns": start, "end_ns": end,
        "duration": None if start is None or end is None else (end - start) / 1e9,
        "messages": sum(index.counts), "chunks": len(index.chunks),
        "compression": _codecs(index.codecs),
        "types": [{"type": datatype, "md5sum": md5sum} for datatype, md5sum in sorted(types)],
        "topics": _topics(index),
        "attachments": [{"name": a.name, "media_type": a.media_type, "size": a.data_size} for a in index.attachments],
        "metadata": [m.name for m in index.metadata], "notes": list(index.notes)}


def _moment(ns: int) -> str:
    return "%s.%02d (%d.%09d)" % (time.strftime("%b %d %Y %H:%M:%S", time.localtime(ns // 10**9)), ns % 10**9 // 10**7,
                                  ns // 10**9, ns % 10**9)


def _duration(seconds: float) -> str:
    if seconds < 60:
        return "%.3f s" % seconds
    minutes, rest = divmod(int(seconds), 60)
    if minutes < 60:
        return "%d:%02d min (%.0f s)" % (minutes, rest, seconds)
    return "%d:%02d:%02d h (%.0f s)" % (minutes // 60, minutes % 60, rest, seconds)


def _mean_rate(topic: Dict[str, Any], duration: Optional[float]) -> str:
    if not duration or topic["messages"] < 2:
        return ""
    return " @ %.4g Hz" % ((topic["messages"] - 1) / duration)


def _text(document: Dict[str, Any]) -> str:
    rows = [("path", document["path"]),
            ("format", "%s %s%s%s" % (
                document["format"], document["version"],
                ", profile %s" % document["profile"] if document["profile"] else "",
                ", written by %s" % document["library"] if document["library"] else ""))]
    if document["duration"] is not None:
        rows += [("duration", _duration(document["duration"])), ("start", _moment(document["start_ns"])),
                 ("end", _moment(document["end_ns"]))]
    if document["path"].endswith(".active"):
        rows.append(("state", "unfinished: still being recorded, or cut off; this is what was whole when it was read"))
    rows += [("size", human_bytes(document["size"])), ("messages", str(document["messages"]))]
    for entry in document["compression"]:
        full = entry["uncompressed"]
        ratio = " (%.1f %% of %s)" % (100.0 * entry["stored"] / full, human_bytes(full)) if full else ""
        rows.append(("compression", "%(codec)s [%(chunks)d/" % entry + "%d chunks]%s" % (document["chunks"], ratio)))
    rows += [("types", "%s [%s]" % (t["type"], t["md5sum"] or "no md5")) for t in document["types"]]
    width = max([len(t["topic"]) for t in document["topics"]] + [0])
    for topic in document["topics"]:
        extra = "%s%s" % (" (%d connections)" % topic["connections"] if topic["connections"] > 1 else "",
                          " (latched)" if topic["latching"] else "")
        rows.append(("topics", "%-*s  %8d msgs%s : %s%s" % (width, topic["topic"], topic["messages"],
                                                           _mean_rate(topic, document["duration"]), topic["type"],
                                                           extra)))
        further = [_losses(topic.get("recorder", {}))] + [topic[key]["text"] for key in ("freq", "seq") if key in topic]
        rows += [("", "%-*s  %s" % (width, "", text)) for text in further if text]
    rows += [("attachments", "%s (%s, %s)" % (a["name"], a["media_type"], human_bytes(a["size"])))
             for a in document["attachments"]]
    rows += [("metadata", name) for name in document["metadata"]]
    rows += [("note", note) for note in document["notes"]]
    rows += _accident_rows(document)
    lines = []
    last = None
    for label, value in rows:
        lines.append("%-14s%s" % ("%s:" % label if label and label != last else "", printable(value)))
        last = label or last
    return "\n".join(lines)


def _add_recorder_account(index: LogIndex, document: Dict[str, Any]) -> None:
    """Add the recorder's account of lost messages by topic."""
    from ..containers.registry import read_metadata
    from ..json_text import load_json

    try:
        for entry in index.metadata:
            if entry.name == DROPS:
                accounts = read_metadata(index, entry)
                for topic in document["topics"]:
                    if topic["topic"] in accounts:
                        account = load_json(accounts[topic["topic"]])
                        if not (isinstance(account, dict)
                                and all(isinstance(account.get(key) or 0, int) for key, _ in _LOSSES)):
                            raise ValueError("that of %s holds no counts" % topic["topic"])
                        topic["recorder"] = account
    except ValueError as error:
        raise BagFormatError("%s: the recorder's account of losses is damaged: %s" % (index.path, error)) from error


def _add_accident(index: LogIndex, document: Dict[str, Any]) -> None:
    """Add a black box's records of triggers, host, clock and versions."""
    from ..containers.registry import read_metadata

    for entry in index.metadata:
        if entry.name == TRIGGER:
            document.setdefault("triggers", []).append(read_metadata(index, entry))
        elif entry.name.startswith(ACCIDENT):  # written at the beginning, and anew at the end
            document.setdefault("black_box", {}).update(read_metadata(index, entry))


def _accident_rows(document: Dict[str, Any]) -> List[Tuple[str, str]]:
    rows = []
    for trigger in document.get("triggers", ()):
        written = trigger.get("time_ns", "")
        at = int(written) if written.isdecimal() and len(written) < 20 else 0
        start = document["start_ns"]
        rows.append(("triggers", "%s%s: %s%s" % (
            _moment(at), "" if start is None else ", %.3f s after the start" % ((at - start) / 1e9),
            trigger.get("kind", ""), " on %s" % trigger["topic"] if trigger.get("topic") else "")))
        rows.append(("", "  %s" % trigger.get("detail", "")))
    rows += [("black box", "%s: %s" % fact) for fact in document.get("black_box", {}).items()]
    return [(label, "".join(c if c.isprintable() else "\\x%02x" % ord(c) for c in text)) for label, text in rows]


def _losses(account: Dict[str, Any]) -> str:
    parts = ["%d %s" % (account[key], words) for key, words in _LOSSES if account.get(key)]
    return "LOST, says the recorder: " + ", ".join(parts) if parts else ""


def _document(path: str, freq: bool, seq: bool) -> Dict[str, Any]:
    if is_rosbag2(path):
        from ..containers.rosbag2_folder import describe
        if seq:
            raise UsageError("%s is a rosbag2 folder: headers of ROS 2 have no seq" % path)
        facts = describe(path)
        if freq:
            from ..operations.timing import add_timing
            add_timing(path, facts)
        else:
            facts["notes"].append("the counts and times are by metadata.yaml (--freq compares them with the files)")
        return facts
    index = read_index(path)
    document = document_of(index)
    if index.format == "bag" and not index.codecs:
        document["compression"] = _codecs(read_codecs(index))
    if DROPS in (entry.name for entry in index.metadata):
        _add_recorder_account(index, document)
    if TRIGGER in (entry.name for entry in index.metadata):
        _add_accident(index, document)
    if freq or seq:
        from ..operations.timing import add_sequence_gaps, add_timing
        if freq:
            add_timing(path, document)
        if seq:
            add_sequence_gaps(path, document)
    return document


def run_files(files: Sequence[str], freq: bool = False, seq: bool = False) -> int:
    """Print the facts for people; return the exit code."""
    rule = ""

    def show(path: str) -> None:
        nonlocal rule
        print(rule + _text(_document(path, freq, seq)))
        rule = "---\n"

    return for_each_file(files, show)


def run(args: "argparse.Namespace") -> int:
    """Print the facts; return the exit code."""
    if not (args.key or args.json or args.yaml):
        return run_files(args.files, args.freq, args.seq)
    documents: List[Dict[str, Any]] = []
    code = for_each_file(args.files, lambda path: documents.append(_document(path, args.freq, args.seq)))
    if not documents:
        return code
    if args.key and args.key not in documents[0]:
        raise UsageError("no key %r; there are: %s" % (args.key, ", ".join(documents[0])))
    import json

    if args.key:
        for document in documents:
            value = document[args.key]
            print(printable(value) if isinstance(value, (str, int, float)) else json.dumps(value))
        return code
    whole = documents[0] if len(documents) == 1 else documents
    if args.yaml:
        import yaml

        print(yaml.safe_dump(whole, sort_keys=False), end="")
    else:
        print(json.dumps(whole, indent=1))
    return code
