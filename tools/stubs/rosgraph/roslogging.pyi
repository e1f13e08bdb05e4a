import logging
from collections.abc import Mapping
from typing import TextIO

class LoggingException(Exception): ...

class RosStreamHandler(logging.Handler):
    def __init__(self, colorize: bool = True, stdout: TextIO | None = None, stderr: TextIO | None = None) -> None: ...

def configure_logging(
    logname: str, level: int = 20, filename: str | None = None, env: Mapping[str, str] | None = None) -> str | None: ...
