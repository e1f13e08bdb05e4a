"""The errors of logs and ROS graphs; each prints as one line."""


class JakaBagError(Exception):
    """Any failure that this package foresees; every other exception is a bug."""


class UsageError(JakaBagError):
    """A command that cannot be carried out as given: its options, or the logs to compare; the exit code is 2."""


class ProtocolError(JakaBagError):
    """A peer's bytes or replies break the protocol (TCPROS, master and slave API)."""


class ConnectionLost(JakaBagError, ConnectionError):
    """A peer cannot be reached, or the link to it broke."""


class BagError(JakaBagError):
    """A log that cannot be read, written or worked with; the text names the file and the reason."""


class BagFormatError(BagError):
    """The bytes are not those of the format: damaged, cut short, encrypted or of another version."""


class LimitReached(BagFormatError):
    """A log that asks for more than a reader gives to one that may come from anyone; the text says how to raise it.

    Attributes:
        WORDS: Part of each text.
    """

    WORDS = "a limit, not damage"


class NotSupported(BagFormatError):
    """A log that is not damaged, but has what this version cannot read."""


class OutputExists(BagError):
    """The output is there already and overwriting was not asked for, or another process is writing it."""


class DefinitionError(BagError):
    """A message definition that cannot be understood, or that does not describe the bytes."""


class TopicRefused(DefinitionError):
    """A topic that the output cannot hold; the log's other topics may be written without it.

    Attributes:
        topic: Name of the topic.
    """

    def __init__(self, reason: str, topic: str = "") -> None:
        super().__init__(reason)  # alone, so that the error can be pickled
        self.topic = topic


class MissingDependency(BagError):
    """An optional library that this operation needs is not installed; the text names it."""


class WriteFailed(BagError):
    """The system refused to write the output; the file is whole up to the record before.

    Attributes:
        errno: The system's error number, as ``errno.ENOSPC`` for a full disk.
    """

    def __init__(self, name: str, error: OSError) -> None:
        super().__init__("cannot write %s: %s" % (name, error.strerror))
        self.errno = error.errno
