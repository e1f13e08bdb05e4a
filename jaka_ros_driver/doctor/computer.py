"""The checks of the computer alone: Python, packages, clock, folders, limits, the disk."""
import contextlib
import ctypes
import importlib
import os
import platform
import resource
import sys
import tempfile
import time
from typing import List, Optional, Tuple

from jaka_ros_driver import __version__
from jaka_ros_driver.doctor.findings import Examination, Observation, fault, good, warning
from jaka_ros_driver.doctor.subject import ExaminedSystem

PACKAGES = ("rospy", "rosgraph", "jaka_msgs", "numpy", "yaml", "mcap", "rosbags")
"""Packages that the driver, or its recorder beside it, cannot do without."""
_OLDEST_PYTHON = (3, 8)
_FULL_MB, _LITTLE_MB = 50.0, 500.0
"""Free space, MB: below the first the log of one file does not fit; below the second not the five that are kept."""
_SLOW_MB_S, _LONG_SYNC_S = 2.0, 1.0
"""Lowest rate, MB/s, and longest pause, s, of a disk for a recorder: an arm makes some 100 kB/s, cameras make more."""
_WRITTEN_MB = 16
"""Size, MB, of the sample that is written: with less a disk's own cache hides its speed, with more a slow one takes
long."""
_BLOCK = b"\0" * (1 << 20)
_FILES = 1024
"""Least limit of open files: the driver needs one for each listener of each topic, beside its own."""
_DAY_S = 86400.0
"""A day, s: the tolerance of a clock that is compared with the time of an installed file, which zones may shift."""
_UNSYNCHRONISED = 5
"""The answer of adjtimex(2), TIME_ERROR, where nothing keeps the clock right."""


def python(subject: ExaminedSystem) -> Observation:
    """Check the interpreter, and that all packages can be imported."""
    versions, missing = [], []
    for name in PACKAGES:
        try:
            version = getattr(importlib.import_module(name), "__version__", "")
            versions.append(("%s %s" % (name, version)).strip())
        except Exception as error:  # a package of another Python fails in many ways
            missing.append("%s (%s)" % (name, str(error).splitlines()[0] if str(error) else type(error).__name__))
    found = "jaka_ros_driver %s, Python %s (%s), %s" % (
        __version__, platform.python_version(), sys.executable, ", ".join(versions))
    if sys.version_info < _OLDEST_PYTHON:
        return fault(found, "the driver needs Python %d.%d" % _OLDEST_PYTHON, "use the Python of ROS Noetic or later")
    if missing:
        return fault("%s; not there: %s" % (found, ", ".join(missing)), "a command that needs them does not start",
                     "source setup.bash of the build in this shell; else install them, as tools/dev setup does")
    return good(found, "the driver can run")


def clock(subject: ExaminedSystem, now: Optional[float] = None) -> Observation:
    """Check that the clock is not before this release was made, and that something keeps it right."""
    now = time.time() if now is None else now
    shown = time.strftime("%Y-%m-%d %H:%M:%S UTC", time.gmtime(now))
    written = os.stat(__file__).st_mtime
    if now < written - _DAY_S:
        return fault("%s, and this release was made later" % shown, "logs and the audit log get wrong times",
                     "set the clock; where it comes back at each boot, replace the computer's battery")
    if _is_unsynchronised():
        return warning("%s, kept right by nothing" % shown, "times of several computers drift apart",
                       "let systemd-timesyncd or chrony keep the clock")
    return good("%s, kept right" % shown, "times can be compared")


def _is_unsynchronised() -> bool:
    with contextlib.suppress(OSError, AttributeError):
        return int(ctypes.CDLL(None).adjtimex(ctypes.create_string_buffer(512))) == _UNSYNCHRONISED
    return False


def log_folder(subject: ExaminedSystem) -> Observation:
    """Check the folder of rospy's log files."""
    folder = log_dir()
    return look_at_folder(folder, "the driver has no log file, and says so; screen and /rosout go on",
                          "give ROS_LOG_DIR a folder that this user can write to")


def log_dir() -> str:
    """Return the folder in which rospy keeps its log files, by rospkg's rules."""
    home = os.environ.get("ROS_HOME") or os.path.join(os.path.expanduser("~"), ".ros")
    return os.environ.get("ROS_LOG_DIR") or os.path.join(home, "log")


def look_at_folder(folder: str, meaning: str, remedy: str) -> Observation:
    """Check that a folder can be made and written, and what room there is; nothing is left behind.

    Args:
        folder: Its path.
        meaning: The consequence where it cannot be written.
        remedy: What to do then.
    """
    present = os.path.abspath(folder)
    while not os.path.lexists(present):
        present = os.path.dirname(present)
    try:
        with tempfile.TemporaryFile(dir=present) as file:
            file.write(b"jaka_doctor")
            file.flush()
            os.fsync(file.fileno())
        free = free_mb(present)
    except OSError as error:
        return fault("%s: %s (user %d)" % (folder, error.strerror or error, os.getuid()), meaning, remedy)
    found = "%s, %.0f MB free" % (folder, free)
    if free < _FULL_MB:
        return fault(found, meaning, "make room on this disk, or: " + remedy)
    if free < _LITTLE_MB:
        return warning(found, "it will be full soon", "make room on this disk, or: " + remedy)
    return good(found, "it can be written")


def free_mb(folder: str) -> float:
    """Return the space, MB, that this user can fill on the disk of a folder."""
    disk = os.statvfs(folder)
    return disk.f_bavail * disk.f_frsize / 1e6


def limits(subject: ExaminedSystem) -> Observation:
    """Check the rights that the kernel gives to a driver: open files, and the priority that was asked for."""
    files = resource.getrlimit(resource.RLIMIT_NOFILE)[0]
    priority = resource.getrlimit(resource.RLIMIT_RTPRIO)[0]
    wanted = subject.config.realtime_priority
    found = "user %d, %s open files, real-time priority up to %s" % (
        os.getuid(), _limit(files), _limit(priority) if os.getuid() else "99 (root)")
    if files != resource.RLIM_INFINITY and files < _FILES:
        return warning(found, "with many listeners the driver has no descriptor left", "ulimit -n %d" % _FILES)
    if wanted and os.getuid() and priority != resource.RLIM_INFINITY and priority < wanted:
        return fault("%s; ~realtime_priority is %d" % (found, wanted), "the driver does not start",
                     "an entry 'USER - rtprio %d' below /etc/security/limits.d, and a new login" % wanted)
    return good(found, "enough for the driver")


def _limit(value: int) -> str:
    return "any number of" if value == resource.RLIM_INFINITY else str(value)


def disk_speed(subject: ExaminedSystem) -> Observation:
    """Measure how fast the disk of the black box, else that of the log, takes what is written."""
    folder = os.path.abspath(subject.black_box or log_dir())
    while not os.path.isdir(folder):
        folder = os.path.dirname(folder)
    try:
        rate, longest = _measured(folder)
    except OSError as error:
        return fault("%s: %s" % (folder, error.strerror or error), "a recorder there would lose messages",
                     "give the black box a folder on a disk that has room")
    found = "%s: %.0f MB/s, at most %.2f s for 1 MB" % (folder, rate, longest)
    if rate < _SLOW_MB_S or longest > _LONG_SYNC_S:
        return warning(found, "a recorder may fall behind, and the file of an accident come late",
                       "record to another disk (black_box:=FOLDER)")
    return good(found, "fast enough for a recorder")


def _measured(folder: str) -> Tuple[float, float]:
    """Return the rate, MB/s, of writing through to the disk, and the longest time, s, for 1 MB."""
    times: List[float] = []
    with tempfile.TemporaryFile(dir=folder) as file:
        for _ in range(_WRITTEN_MB):
            begun = time.monotonic()
            file.write(_BLOCK)
            file.flush()
            os.fsync(file.fileno())
            times.append(time.monotonic() - begun)
    return _WRITTEN_MB * len(_BLOCK) / 1e6 / max(sum(times), 1e-9), max(times)


CHECKS = (
    Examination("Python and packages", python),
    Examination("clock", clock),
    Examination("log folder", log_folder),
    Examination("rights", limits),
    Examination("disk for a recorder", disk_speed),
)
