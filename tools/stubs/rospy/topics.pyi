import threading
from typing import Any, Callable, Generic, TypeVar, overload

import genpy

_M = TypeVar("_M", bound=genpy.Message)
_A = TypeVar("_A")

class Topic:
    resolved_name: str
    name: str
    def __init__(self, name: str, data_class: Any, reg_type: str) -> None: ...
    def get_num_connections(self) -> int: ...
    def unregister(self) -> None: ...

class Publisher(Topic, Generic[_M]):
    data_class: type[_M]
    impl: _PublisherImpl
    # Without a queue size a subscriber that has stopped holds up the publisher: so it is no option here.
    def __init__(
        self,
        name: str,
        data_class: type[_M],
        subscriber_listener: None = None,
        tcp_nodelay: bool = False,
        latch: bool = False,
        headers: dict[str, str] | None = None,
        *,
        queue_size: int,
    ) -> None: ...
    # rospy takes the fields of a message, too; here it is always the message.
    def publish(self, message: _M, /) -> None: ...

class Subscriber(Topic):
    @overload
    def __init__(
        self,
        name: str,
        data_class: type[_M],
        callback: Callable[[_M], object],
        *,
        queue_size: int | None = None,
        buff_size: int = ...,
        tcp_nodelay: bool = False,
    ) -> None: ...
    @overload
    def __init__(
        self,
        name: str,
        data_class: type[_M],
        callback: Callable[[_M, _A], object],
        callback_args: _A,
        queue_size: int | None = None,
        buff_size: int = ...,
        tcp_nodelay: bool = False,
    ) -> None: ...

class _TopicImpl:
    def __init__(self, name: str, data_class: Any) -> None: ...
    c_lock: threading.RLock
    # Each has the methods of a transport.
    connections: list[Any]
    ref_count: int
    closed: bool
    seq: int

class _PublisherImpl(_TopicImpl):
    message_data_sent: int
    publock: threading.RLock | None
    queue_size: int | None
    def add_connection(self, c: Any) -> bool: ...

class _TopicManager:
    pubs: dict[str, _TopicImpl]
    subs: dict[str, _TopicImpl]
    def get_publications(self) -> list[tuple[str, str]]: ...
    def get_subscriber_impl(self, resolved_name: str) -> _TopicImpl: ...
    def get_subscriptions(self) -> list[tuple[str, str]]: ...
    def get_topics(self) -> set[str]: ...

def get_topic_manager() -> _TopicManager: ...
