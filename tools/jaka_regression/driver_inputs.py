"""The messages of a log that a driver took as input: goals, cancels, trajectories, paths, jog and servo targets."""
from typing import Dict, List, NamedTuple, Optional, Set, Tuple, Union

from jaka_bag.compare.runs.run import Call, Run
from jaka_bag.containers.registry import open_log
from jaka_bag.containers.time_order import messages_of
from jaka_bag.driver_interface import INPUT_TOPICS
from jaka_bag.messages.connection import Connection
from jaka_bag.messages.selection import Selection
from jaka_bag.messages.values import ValueReaders
from jaka_bag.paths import PathLike
from jaka_bag.units import NS_PER_S

_SUCCEEDED = 3
"""``SUCCEEDED`` of actionlib_msgs/GoalStatus."""


class SentMessage(NamedTuple):
    """One message that somebody sent to a driver.

    Attributes:
        connection: Its topic, type, md5 and definition, and who sent it.
        start: Time of recording, s since the log's begin.
        duration: Time until the result of its goal, s; 0 where it is no goal, or has no result in the log.
        data: Its bytes.
        goal_id: Id of the goal; empty where it is none.
        success: Its goal SUCCEEDED; True where it is no goal.
        recorded_ns: Time of recording, ns since the epoch.
    """

    connection: Connection
    start: float
    duration: float
    data: bytes
    goal_id: str
    success: bool
    recorded_ns: int

    @property
    def end(self) -> float:
        """The time of the goal's result, s."""
        return self.start + self.duration

    @property
    def short_name(self) -> str:
        """The topic's last word, for a goal with its action's: ``follow_joint_trajectory/goal``."""
        words = self.connection.topic.split("/")
        return "/".join(words[-2:]) if words[-1] in ("goal", "cancel") else words[-1]

    @property
    def words(self) -> str:
        """The message in a few words."""
        return "%s(%s)" % (self.short_name, self.goal_id or "%d bytes" % len(self.data))

    @property
    def service(self) -> str:
        """The topic: where a call has its service."""
        return self.connection.topic

    @property
    def request_text(self) -> str:
        """The message in a few words: where a call has its request."""
        return self.goal_id or "%d bytes" % len(self.data)


Input = Union[Call, SentMessage]


def input_topics(run: Run) -> Set[str]:
    """Return the topics of a log that are inputs of a driver, by name and type."""
    return {topic for topic, stream in run.streams.items() for name, kind in INPUT_TOPICS.items()
            if topic.endswith("/" + name) and kind in [datatype for datatype, _ in stream.types]}


def inputs_of(path: PathLike, run: Run) -> List[Input]:
    """Return the calls and messages that drivers took, by time; ``run`` is the log loaded.

    Raises:
        BagError: The log cannot be read.
        DefinitionError: A definition does not describe its messages.
    """
    wanted = input_topics(run)
    results = {topic[:-len("goal")] + "result" for topic in wanted if topic.endswith("/goal")} & set(run.streams)
    sent: List[SentMessage] = []
    ends: Dict[Tuple[str, str], Tuple[float, bool]] = {}
    if wanted:
        readers = ValueReaders()
        with open_log(path) as log:
            for message in messages_of(log, Selection(topics=sorted(wanted | results))):
                connection = message.connection
                time = (message.log_time - run.start_ns) / NS_PER_S
                reader = readers[connection]
                if connection.topic in results:
                    status = reader.read(message.data)["status"]
                    ends.setdefault((connection.topic[:-len("result")], status["goal_id"]["id"]),
                                    (time, status["status"] == _SUCCEEDED))
                else:
                    goal = reader.read(message.data)["goal_id"]["id"] if connection.topic.endswith("/goal") else ""
                    sent.append(SentMessage(connection, time, 0.0, bytes(message.data), goal, True, message.log_time))
    return sorted([*run.calls, *[_with_end(one, ends) for one in sent]], key=lambda one: one.start)


def _with_end(message: SentMessage, ends: Dict[Tuple[str, str], Tuple[float, bool]]) -> SentMessage:
    end: Optional[Tuple[float, bool]] = ends.get((message.connection.topic[:-len("goal")], message.goal_id))
    if not message.goal_id or end is None:
        return message
    return message._replace(duration=max(0.0, end[0] - message.start), success=end[1])
