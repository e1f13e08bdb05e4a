"""State logs: read, write, record, play, convert, inspect and compare ROS 1 ``.bag`` and ``.mcap`` files.

Needs no ROS, not even to record from a running ROS 1 system or to play into it. The rooms, from the ground up; a room
imports only from those above it in this list:

errors, units        what can go wrong; ns, ms and mm
interrupts           Ctrl-C and SIGTERM, once
driver_interface     types and numbers in the topics of JAKA drivers, and what they ask of no joint
json_text, yaml_text  texts of files and strangers, bounded in depth
log_records          names of the metadata records that recorders leave in a log
paths, output_file   names of files; outputs that appear only when whole
pipeline             work on several threads, results in order
allocator            freed memory, kept for the next chunk of a log
messages             many messages in few numpy arrays: definitions, layouts, columns, CDR, selection
containers           the formats: one interface for readers and writers, .bag, .mcap, rosbag2 folders
operations           convert, merge, split, recover, export, plot, timing
live                 the ROS graph without ROS: subscribe, publish, record, play
compare              does the arm still do what it did? a log against a golden one, and the reports
engines              one task a log: here, in processes, on Dask
cli                  the command ``jaka_bag``, one module a subcommand
__main__             the same as a module that Python can run

For Python code: ``open_log``, ``read_index``, ``create_log``, ``messages_of`` and ``read_columns`` of this package.
"""
from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .containers.registry import create_log as create_log
    from .containers.registry import open_log as open_log
    from .containers.registry import read_index as read_index
    from .containers.time_order import messages_of as messages_of
    from .operations.columns import read_columns as read_columns

__version__ = "0.3.0"

_HOMES = {"create_log": "jaka_bag.containers.registry", "messages_of": "jaka_bag.containers.time_order",
          "open_log": "jaka_bag.containers.registry", "read_columns": "jaka_bag.operations.columns",
          "read_index": "jaka_bag.containers.registry"}


def __getattr__(name: str) -> Any:
    """Import what is used when it is first used: ``jaka_bag info`` starts without numpy."""
    if name not in _HOMES:
        raise AttributeError("module %r has no attribute %r" % (__name__, name))
    return getattr(import_module(_HOMES[name]), name)
