"""The view of an open log in which messages of other encodings are those of ROS 1."""
from typing import Dict

import numpy as np

from ..errors import DefinitionError, TopicRefused
from ..messages.batch import Array, MessageBatch, concatenate, converted, distinct
from ..messages.encodings import Ros1Form, described, ros1_form
from .index import AttachmentIndex, ChunkRef, MetadataIndex
from .interface import LogReader


class Ros1View(LogReader):
    """A log whose CDR and JSON messages are read as ROS 1 messages; those without a ROS 1 form stay as they are.

    Args:
        reader: The open log; it is closed with the view.
        forms: ROS 1 forms by number of the connection.
    """

    def __init__(self, reader: LogReader, forms: Dict[int, Ros1Form]) -> None:
        super().__init__(reader._file, reader.index._replace(
            connections=[described(connection) for connection in reader.connections], profile="ros1"))
        self._reader = reader
        self._all_forms = self._forms = forms

    def load(self, chunk: ChunkRef) -> MessageBatch:
        """Return the messages of one chunk; see ``LogReader``.

        Raises:
            TopicRefused: A message does not fit its definition.
        """
        batch = self._reader.load(chunk)
        numbers = distinct(batch.connection).tolist()
        if not any(number in self._forms for number in numbers):
            return batch
        places = [np.flatnonzero(batch.connection == number) for number in numbers]
        parts = [self._converted(batch, number, which) for number, which in zip(numbers, places)]
        return concatenate(parts).take(np.argsort(np.concatenate(places)))

    def decode_only(self, wanted: Array) -> None:
        """See ``LogReader``; messages of the others stay as they are."""
        self._forms = {number: form for number, form in self._all_forms.items() if wanted[number]}

    def _converted(self, batch: MessageBatch, number: int, which: Array) -> MessageBatch:
        """Return the messages of one connection, at some positions of a batch, as those of ROS 1."""
        if number not in self._forms:
            return batch.take(which)
        try:
            return converted(batch, which, self._forms[number].convert)
        except DefinitionError as error:
            raise TopicRefused("%s: %s" % (self.path, error), self.connections[number].topic) from error

    def read_attachment(self, entry: AttachmentIndex) -> bytes:
        """See ``LogReader``."""
        return self._reader.read_attachment(entry)

    def read_metadata(self, entry: MetadataIndex) -> Dict[str, str]:
        """See ``LogReader``."""
        return self._reader.read_metadata(entry)


def as_ros1_log(reader: LogReader) -> LogReader:
    """Return the view of an open log as one of ROS 1; the log itself where it has nothing to convert."""
    forms: Dict[int, Ros1Form] = {}
    for number, (connection, plain) in enumerate(zip(reader.connections, map(described, reader.connections))):
        if plain is not connection:
            form = ros1_form(connection)
            assert form is not None
            forms[number] = form
    return Ros1View(reader, forms) if forms else reader


def without_ros1_form(reader: LogReader) -> Dict[str, str]:
    """Return the topics of ``as_ros1_log`` whose messages are none of ROS 1, with the reason."""
    found: Dict[str, str] = {}
    for connection in reader.connections:
        try:
            ros1_form(connection)
        except DefinitionError as error:
            found.setdefault(connection.topic, str(error))
    return found
