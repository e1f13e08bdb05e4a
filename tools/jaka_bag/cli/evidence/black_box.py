"""``jaka_bag record --black-box``: its options, and the parts of the black box put together."""
import argparse
import contextlib
import dataclasses
import os
import time
from pathlib import Path
from typing import Any, Callable, Dict, Optional, Tuple

from ...black_box.evidence import FACTS_RECORD, Evidence
from ...black_box.expression import Expression
from ...black_box.files import Keep, cut_off_files
from ...black_box.recorder import ITEM_BYTES, BlackBox, Window, started_line
from ...black_box.service import TriggerService
from ...black_box.triggers import Trigger, TriggerWatch
from ...errors import BagError, OutputExists, UsageError
from ...live.graph import master_uri
from ...live.names import NodeNames
from ...live.rolling_files import FileSettings, RollingFiles
from ...live.stream_account import TopicDrops
from ...live.topic_selection import TopicSelection
from ...live.writer_thread import WriterThread
from ...operations.recover import recover
from ...operations.signature import sign
from ...output_file import is_being_written
from ...units import NS_PER_S
from .. import quantities
from ..notices import Notices

NODE = "jaka_black_box"
"""Name of the node; with a fixed name, so that its service has one."""
_DRIVER = "jaka_driver"
_SERVICE = "~trigger"
_BEFORE_S, _AFTER_S = 60.0, 20.0
_TRIGGERS = ("error", "emergency stop", "collision", "failed service call", "diagnostics ERROR", "service ~trigger",
             "SIGUSR1")
_ALONE = ("output_name", "output_prefix", "split", "size", "duration", "snapshot", "limit", "max_splits")


def add_options(parser: argparse.ArgumentParser) -> None:
    """Declare the options of the black box."""
    group = parser.add_argument_group("black box")
    group.add_argument("--black-box", type=quantities.given, metavar="DIR",
                       help="keep the newest messages in memory; write a file to DIR around each accident")
    add = group.add_argument
    add("--before", type=quantities.duration, metavar="TIME", help="from so long before it (default 60s)")
    add("--after", type=quantities.duration, metavar="TIME", help="until so long after it (default 20s)")
    add("--trigger", action="append", default=[], metavar="CONDITION",
        help="also where this becomes true, as 'TOPIC.field > 3'; may be repeated")
    add("--keep", type=quantities.count, metavar="N", help="keep the newest N files in DIR (default all)")
    add("--keep-bytes", type=quantities.size, metavar="SIZE",
        help="keep the newest files in DIR that have this size in all (k, M, G)")


def check(args: argparse.Namespace) -> None:
    """Refuse options that do not go together; set the defaults of those that do.

    Raises:
        UsageError: They do not.
    """
    if not args.black_box:
        for name in ("before", "after", "trigger", "keep", "keep_bytes"):
            if getattr(args, name) not in (None, []):
                raise UsageError("--%s needs --black-box DIR" % name.replace("_", "-"))
        return
    for name in _ALONE:
        if getattr(args, name):
            raise UsageError("--black-box and --%s do not go together" % name.replace("_", "-"))
    if args.format == "bag":
        raise UsageError("a black box writes .mcap: a .bag has no place for what makes its files complete")
    if not args.buffsize:
        raise UsageError("a black box needs a limit of its memory: --buffsize MB")
    args.before = _BEFORE_S if args.before is None else args.before
    args.after = _AFTER_S if args.after is None else args.after
    args.output_name = str(Path(args.black_box) / "blackbox")


class Assembly:
    """The parts of one black box.

    Args:
        args: The command line.
        names: Who the node is.
        settings: How files are stored; their names are the black box's own.
        facts: Facts of the recording, for each file.
        console: Where notices go.
        key: Private key that finished files are signed with; None: they are not.

    Raises:
        BagError: The folder cannot be made or written.
        UsageError: A condition is not understood.
    """

    item_bytes = ITEM_BYTES

    def __init__(self, args: argparse.Namespace, names: NodeNames, settings: FileSettings, facts: Dict[str, str],
                 console: Notices, key: Any = None) -> None:
        self._names = names
        self._settings = settings
        self._facts = facts
        self._console = console
        self._key = key
        self._keep = Keep(args.keep or 0, args.keep_bytes or 0)
        self._folder = Path(args.black_box)
        self._expressions = [Expression(text, names.resolve) for text in args.trigger]
        self.memory_bytes = max(args.buffsize // 2, 1)
        self._window = Window(args.before, args.after, self.memory_bytes)
        self._watch = TriggerWatch(self._expressions, console.always)
        self._evidence = Evidence(master_uri(), names.node, names.resolve(_DRIVER), self._diagnostics, self._look_after)
        self._service: Optional[TriggerService] = None
        self._box: Optional[BlackBox] = None
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise BagError("cannot make the folder %s: %s" % (self._folder, error.strerror)) from error
        if not os.access(str(self._folder), os.W_OK | os.X_OK):
            raise BagError("cannot write into the folder %s" % self._folder)

    @property
    def failures(self) -> int:
        """Files that could not be begun or finished."""
        return 0 if self._box is None else self._box.failures

    def selection(self, selection: TopicSelection) -> TopicSelection:
        """The topics to be recorded, those of the conditions among them."""
        more = tuple(dict.fromkeys(topic for expression in self._expressions for topic in expression.topics
                                   if topic not in selection.names))
        return dataclasses.replace(selection, names=selection.names + more)

    def open(self, recorder: WriterThread) -> BlackBox:
        """The black box itself; called when recording begins."""
        def clock() -> float:
            if recorder.is_simulated_time:
                return (recorder.clock or 0) / NS_PER_S
            return time.monotonic()

        def log_time() -> int:
            return (recorder.clock or 0) if recorder.is_simulated_time else time.time_ns()

        def open_file(stem: Path, drops: Callable[[], Dict[str, TopicDrops]]) -> RollingFiles:
            facts = dict(self._facts, before_s="%g" % self._window.before_s, after_s="%g" % self._window.after_s)
            files = RollingFiles(dataclasses.replace(self._settings, stem=stem), facts, self._evidence.attachments(),
                                 recorder.streams, self._console.say, drops)
            files.add_metadata(FACTS_RECORD, self._evidence.facts())
            return files

        self._make_leftovers_whole()
        self._box = BlackBox(self._folder, self._window, self._watch, open_file, recorder.streams, clock,
                             log_time, self._console.always, self._keep, self._before_end, self._after_end)
        triggers = list(_TRIGGERS) + [expression.text for expression in self._expressions]
        self._console.say(started_line(self._window, self._folder, triggers))
        return self._box

    def start(self, node_uri: str) -> None:
        """Offer the service, collect evidence."""
        self._service = TriggerService(self._names.resolve(_SERVICE), self._names.node, node_uri, self._on_call)
        self._service.register()
        self._evidence.start()

    def close(self) -> None:
        """End what ``start`` began."""
        self._evidence.close()
        if self._service is not None:
            self._service.close()

    def on_signal(self) -> None:
        """SIGUSR1 came."""
        if self._box is not None:
            self._box.trigger(Trigger("signal", "SIGUSR1", ""))

    def _on_call(self) -> Tuple[bool, str]:
        assert self._box is not None
        name = self._names.resolve(_SERVICE)
        return self._box.trigger(Trigger("service", "%s was called" % name, name)).wait()

    def _look_after(self) -> None:
        if self._service is not None:
            self._service.register()

    def _diagnostics(self) -> Dict[str, Dict[str, object]]:
        return dict(self._watch.diagnostics)

    def _before_end(self, files: RollingFiles) -> None:
        files.add_attachment(self._evidence.last_attachment())
        files.add_metadata(FACTS_RECORD + ".end", self._evidence.facts())

    def _after_end(self, path: Path) -> None:
        if self._key is not None:
            self._console.say("signed: %s" % sign(path, self._key))

    def _make_leftovers_whole(self) -> None:
        """Finish the files of black boxes that were killed; what cannot be read stays as it is."""
        for path in cut_off_files(self._folder):
            target = path.with_suffix("")
            if is_being_written(path):
                continue
            try:
                result = recover(path, target)
            except OutputExists:
                continue
            except BagError as error:
                self._console.always("%s was cut off: %s" % (path, error))
                continue
            with contextlib.suppress(OSError):
                path.unlink()
            self._console.always("%s was cut off; made whole: %d messages" % (target, result.messages))
            self._after_end(target)
