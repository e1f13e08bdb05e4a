"""The names that ``rosbag`` (1.15), foxglove's ``mcap`` and ``ros2 bag`` give to the commands and options of
jaka_bag.
"""
from typing import Dict, NamedTuple


class Peers(NamedTuple):
    """The same thing in the three other tools; empty where one has nothing like it."""

    rosbag: str = ""
    mcap: str = ""
    ros2: str = ""


COMMANDS: Dict[str, Peers] = {
    "record": Peers("record", "", "record"),
    "play": Peers("play", "", "play"),
    "info": Peers("info", "info", "info"),
    "convert": Peers("compress, decompress", "convert, compress, decompress", "convert"),
    "filter": Peers("filter", "filter", "convert"),
    "merge": Peers("", "merge, sort", "convert"),
    "split": Peers("", "split", "convert"),
    "recover": Peers("reindex", "recover", "reindex"),
    "cat": Peers("", "cat", ""),
    "du": Peers("", "du", ""),
    "doctor": Peers("check", "doctor", ""),
    "attach": Peers("", "add attachment, add metadata", ""),
    "extract": Peers("", "list, get attachment, get metadata", ""),
    "completion": Peers("", "completion", ""),
}
"""Counterparts by command of jaka_bag; a command that is missing here has none."""

_TOPICS = Peers("", "--topics", "--topics")
_SELECTION = {
    "--topics": Peers("", "", "--topics"), "--regex": Peers("", "-y", "--regex"),
    "--exclude": Peers("", "-n", "--exclude-regex"), "--start": Peers("", "-s", ""), "--until": Peers("", "-e", "")}
_OUTPUT = {"--output": Peers("", "-o", "-o")}
_COMPRESSION = {"--compression": Peers("", "--output-compression", "")}

OPTIONS: Dict[str, Dict[str, Peers]] = {
    "record": {
        "--all": Peers("-a, --all", "", "-a, --all"), "--regex": Peers("-e, --regex", "", "-e, --regex"),
        "--exclude": Peers("-x, --exclude", "", "--exclude-regex"), "--node": Peers("--node"),
        "--limit": Peers("-l, --limit"), "--output-prefix": Peers("-o, --output-prefix"),
        "--output-name": Peers("-O, --output-name", "", "-o, --output"),
        "--format": Peers("", "", "-s, --storage"), "--split": Peers("--split"),
        "--size": Peers("--size", "", "-b, --max-bag-size"), "--duration": Peers("--duration", "",
                                                                              "-d, --max-bag-duration"),
        "--max-splits": Peers("--max-splits", "", "--max-bag-files"), "--zstd": Peers("", "", "--compression-format"),
        "--lz4": Peers("--lz4"), "--bz2": Peers("-j, --bz2"), "--buffsize": Peers("-b, --buffsize", "",
                                                                                "--max-cache-size"),
        "--chunksize": Peers("--chunksize"), "--snapshot": Peers("", "", "--snapshot-mode"),
        "--repeat-latched": Peers("--repeat-latched", "", "--repeat-transient-local"),
        "--tcpnodelay": Peers("--tcpnodelay"), "--quiet": Peers("-q, --quiet"),
    },
    "play": {
        "--bags": Peers("--bags"), "--topics": Peers("--topics", "", "--topics"), "--start": Peers("-s, --start", "",
                                                                                                 "--start-offset"),
        "--duration": Peers("-u, --duration", "", "--playback-duration"), "--prefix": Peers("-p, --prefix"),
        "--until": Peers("", "", "--playback-until-sec"), "--regex": Peers("", "", "--regex"),
        "--exclude": Peers("", "", "--exclude-regex"),
        "--rate": Peers("-r, --rate", "", "-r, --rate"), "--immediate": Peers("-i, --immediate"),
        "--loop": Peers("-l, --loop", "", "-l, --loop"), "--keep-alive": Peers("-k, --keep-alive"),
        "--pause": Peers("--pause", "", "-p, --start-paused"), "--delay": Peers("-d, --delay", "", "-d, --delay"),
        "--wait-for-subscribers": Peers("--wait-for-subscribers"), "--skip-empty": Peers("--skip-empty"),
        "--clock": Peers("--clock", "", "--clock"), "--hz": Peers("--hz", "", "--clock HZ"),
        "--quiet": Peers("-q, --quiet"),
    },
    "info": {"--freq": Peers("--freq"), "--key": Peers("-k, --key"), "--yaml": Peers("-y, --yaml")},
    "convert": {
        **_OUTPUT, "--force": Peers("-f, --force"),
        "--lz4": Peers("compress --lz4"), "--bz2": Peers("compress -j"),
        "--compression": Peers("", "--compression", "")},
    "filter": {**_SELECTION, **_OUTPUT, **_COMPRESSION},
    "merge": {"--output": Peers("", "-o", "-o"), "--compression": Peers("", "--compression", "")},
    "split": {},
    "recover": {"--output": Peers("--output-dir", "-o", ""), "--force": Peers("-f, --force"),
                "--quiet": Peers("-q, --quiet"), "--compression": Peers("", "--compression", "")},
    "cat": {"--topics": _TOPICS, "--start": Peers("", "--start-secs", ""), "--until": Peers("", "--end-secs", "")},
    "attach": {"--name": Peers("", "--name", ""), "--media-type": Peers("", "--content-type", ""),
               "--metadata": Peers("", "add metadata --key", "")},
    "extract": {"--output": Peers("", "--output", "")},
}
"""Counterparts by command and the option's longest name; an option that is missing here has none."""

WITHOUT: Dict[str, str] = {
    "record --publish": "no message at the beginning", "record --udp": "TCP alone",
    "play --queue": "no message is dropped: a subscriber that does not keep up holds the player up",
    "play --try-future-version": "there is none", "play --pause-topics": "space pauses and goes on",
    "play --rate-control-topic": "not there", "play --rate-control-max-delay": "not there",
    "filter --print": "the options choose; for an expression over fields, read the log from Python",
    "compress --output-dir": "the output is named", "decompress --output-dir": "the output is named",
    "check --genrules": "messages are not migrated", "check --append": "messages are not migrated",
    "check --noplugins": "messages are not migrated",
}
"""Options of ``rosbag`` that have no counterpart, and what is instead."""
