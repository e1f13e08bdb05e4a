"""The file for a bug report: the doctor's report, the parameters, the newest log of the driver, without secrets."""
import contextlib
import glob
import io
import json
import os
import platform
import re
import tarfile
import time
from typing import Any, Dict, List, Optional

import yaml

from jaka_ros_driver.doctor.computer import log_dir
from jaka_ros_driver.doctor.subject import ExaminedSystem

_LONGEST_LOG = 1 << 20
"""Bytes of the newest log that are kept, from its end."""
_VARIABLES = re.compile(r"ROS_[A-Z_]+|CMAKE_PREFIX_PATH|PYTHON[A-Z]*|LANG|LC_[A-Z]+|TZ|XDG_RUNTIME_DIR")
"""Variables of the environment that are kept; all others may hold anything."""
_HIDDEN = "(hidden)"
_SECRET_NAMES = r"[\w.-]*(?:token|passw(?:or)?d|passphrase|secret|api_?key|private_?key|credential)[\w.-]*"
_SECRETS = (
    (re.compile(r"-----BEGIN [A-Z ]*PRIVATE KEY-----.*?(?:-----END [A-Z ]*PRIVATE KEY-----|\Z)", re.DOTALL), _HIDDEN),
    (re.compile(r"(://)[^/\s:@]*:[^/\s@]*@"), r"\1%s@" % _HIDDEN),
    (re.compile(r"(?i)(authorization\s*[:=]\s*)[^\r\n]+"), r"\1" + _HIDDEN),
    (re.compile(r"""(?i)\b(%s["']?\s*(?::=|[:=]|\s)\s*)("[^"\n]*"|'[^'\n]*'|[^\s,;&"']+)""" % _SECRET_NAMES),
     r"\1" + _HIDDEN),
)


def write(path: str, subject: ExaminedSystem, report: str, report_json: str) -> List[str]:
    """Write a new bundle, readable for its owner only; return the names of what is in it.

    Args:
        path: Its file, which must not be there.
        subject: What was examined.
        report: The doctor's report for people.
        report_json: The same as JSON.

    Raises:
        OSError: It is there, or cannot be written; what was begun is removed.
    """
    contents = {
        "report.txt": report, "report.json": report_json,
        "parameters.yaml": yaml.safe_dump(_plain(subject.values), default_flow_style=False),
        "environment.txt": "".join("%s=%s\n" % item for item in sorted(os.environ.items())
                                   if _VARIABLES.fullmatch(item[0])),
        "system.txt": _system(),
        "status_frame.json": json.dumps(subject.feed.newest, indent=1) if subject.has_controller else "",
        "driver.log": _newest_log(subject.node)}
    kept = {name: without_secrets(text) for name, text in contents.items() if text}
    descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    try:
        with open(descriptor, "wb") as file, tarfile.open(fileobj=file, mode="w:gz") as archive:
            for name, text in kept.items():
                entry = tarfile.TarInfo("jaka_doctor/" + name)
                data = text.encode("utf-8", "replace")
                entry.size, entry.mtime, entry.mode = len(data), int(time.time()), 0o600
                archive.addfile(entry, io.BytesIO(data))
    except OSError:
        with contextlib.suppress(OSError):
            os.unlink(path)
        raise
    return list(kept)


def without_secrets(text: str) -> str:
    """Return a text in which the values of passwords, tokens and keys are hidden."""
    for pattern, replacement in _SECRETS:
        text = pattern.sub(replacement, text)
    return text


def _plain(values: Dict[str, Any]) -> Dict[str, Any]:
    plain: Dict[str, Any] = json.loads(json.dumps(values, default=str))
    return plain


def _system() -> str:
    lines = [" ".join(platform.uname()), "%d processors, load %.2f %.2f %.2f" % (os.cpu_count() or 0, *os.getloadavg())]
    for path, pattern in (("/etc/os-release", "PRETTY_NAME="), ("/proc/meminfo", "Mem"), ("/proc/net/dev", "")):
        with contextlib.suppress(OSError), open(path, encoding="utf-8", errors="replace") as file:
            lines += [line.rstrip() for line in file if line.startswith(pattern)]
    return "\n".join(lines) + "\n"


def _newest_log(node: str) -> str:
    """Return the end of the newest log file of a node that is where rospy keeps them; "" where there is none."""
    name = glob.escape(node.strip("/").replace("/", "-"))
    newest: Optional[str] = None
    for pattern in ("*.log", "*/*.log"):
        for path in glob.glob(os.path.join(glob.escape(log_dir()), pattern.replace("*.log", name + "*.log"))):
            with contextlib.suppress(OSError):
                if newest is None or os.stat(path).st_mtime > os.stat(newest).st_mtime:
                    newest = path
    if newest is None:
        return ""
    try:
        with open(newest, "rb") as file:
            file.seek(max(0, os.fstat(file.fileno()).st_size - _LONGEST_LOG))
            return file.read().decode("utf-8", "replace")
    except OSError as error:
        return "%s: %s\n" % (newest, error)
