from typing import Any, Callable, Sequence, TypeVar

_M = TypeVar("_M")

# Parameters are values of YAML.
def get_param(param_name: str, default: Any = ...) -> Any: ...
def init_node(
    name: str,
    argv: Sequence[str] | None = None,
    anonymous: bool = False,
    log_level: int | None = None,
    disable_rostime: bool = False,
    disable_rosout: bool = False,
    disable_signals: bool = False,
    xmlrpc_port: int = 0,
    tcpros_port: int = 0,
) -> None: ...
def myargv(argv: Sequence[str] | None = None) -> list[str]: ...
def on_shutdown(h: Callable[[], object]) -> None: ...
def set_param(param_name: str, param_value: Any) -> None: ...
def wait_for_message(topic: str, topic_type: type[_M], timeout: float | None = None) -> _M: ...
