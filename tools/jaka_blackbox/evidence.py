"""The evidence that a file of the black box holds besides its messages, for whoever reads it years later.

Parameters are asked for again and again while all is well: at a trigger the master may be gone, and at the start of the
black box the driver may not have set any yet. The model file that one of them names is read then, too: whatever it is,
it holds up no accident's file.
"""
import ctypes
import importlib.util
import json
import platform
import sys
import threading
import time
from pathlib import Path
from typing import Any, Callable, Dict, List, Optional, Tuple

from jaka_bag import __version__
from jaka_bag.driver_interface import PARAMETERS_NAME
from jaka_bag.errors import BagError, JakaBagError
from jaka_bag.live.graph import RemoteNode
from jaka_bag.live.rolling_files import Attachment
from jaka_bag.live.session import parameter_dump

from .model_file import read_model_file

_FIRST_PERIOD_S, _PERIOD_S = 1.0, 10.0
"""Period, s, of asking for parameters until they are known, and then: they change seldom."""
_STA_UNSYNC = 0x40
_TIME_ERROR = 5
_US = 1e-6
_PACKAGES = ("numpy", "lz4", "zstandard", "cryptography")
_VERSION_KEYS = {"driver": "driver_version", "controller": "controller_version", "model": "model",
                 "interface": "interface"}


class _Timex(ctypes.Structure):
    """The beginning of ``struct timex`` (adjtimex(2)), and room for the rest of it."""

    _fields_ = [("modes", ctypes.c_uint), ("offset", ctypes.c_long), ("freq", ctypes.c_long),
                ("maxerror", ctypes.c_long), ("esterror", ctypes.c_long), ("status", ctypes.c_int),
                ("rest", ctypes.c_char * 256)]


def clock_state() -> str:
    """Return in words whether a time service disciplines the kernel's clock, and how large its error may be."""
    try:
        state = _Timex()
        code = ctypes.CDLL(None, use_errno=True).adjtimex(ctypes.byref(state))
    except (OSError, AttributeError) as error:
        return "unknown: %s" % error
    if code < 0:
        return "unknown: adjtimex is refused"
    if code == _TIME_ERROR or state.status & _STA_UNSYNC:
        return "not synchronised"
    return "synchronised (NTP), estimated error %.6f s, at most %.3f s" % (state.esterror * _US, state.maxerror * _US)


def package_versions() -> Dict[str, str]:
    """Return the versions of the software that takes part in the recording, by name."""
    from importlib import metadata

    versions = {"jaka_bag": __version__, "python": platform.python_version(), "system": platform.platform()}
    for name in _PACKAGES:
        try:
            versions[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            continue
    return versions


def _models_file() -> Optional[Path]:
    """Return the driver's table of arms with their DH parameters; None where the driver is not installed.

    The sub-package is looked up by name, not beside its parent: in catkin's devel space the parent is a relay to the
    checkout, in whose folder there is nothing else. Of the driver only the parent's ``__init__`` is run by this.
    """
    try:
        spec = importlib.util.find_spec(".kinematics", "jaka_ros_driver")
    except ModuleNotFoundError:
        return None
    for folder in (spec.submodule_search_locations or ()) if spec is not None else ():
        path = Path(folder, "data", "models.yaml")
        if path.is_file():
            return path
    return None


def _content(path: Optional[Path]) -> Optional[bytes]:
    try:
        return None if path is None else path.read_bytes()
    except OSError:
        return None


class Evidence:
    """A collector of parameters and other evidence, working in the background from ``start`` to ``close``.

    Args:
        master_uri: URI of the ROS master.
        node: Global name of the asking node.
        driver: Global name of the driver's node, whose parameters name the arm.
        diagnostics: Returns the newest status of each name.
        beside: Called from the collecting thread in each round, for further periodic work.
    """

    def __init__(self, master_uri: str, node: str, driver: str, diagnostics: Callable[[], Dict[str, Dict[str, Any]]],
                 beside: Callable[[], None] = lambda: None) -> None:
        self._master_uri = master_uri
        self._node = node
        self._driver = driver
        self._diagnostics = diagnostics
        self._beside = beside
        self._versions = self._json(package_versions())
        self._models = _content(_models_file())
        self._parameters = b""
        self._model_file: Tuple[Optional[bytes], str] = (None, "")  # content, or why there is none
        self._asked_at = 0.0
        self._ending = threading.Event()
        self._thread = threading.Thread(target=self._run, name="evidence", daemon=True)

    def start(self) -> None:
        """Begin to collect."""
        self._thread.start()

    def close(self) -> None:
        """Stop collecting."""
        self._ending.set()
        if self._thread.ident is not None:
            self._thread.join()

    def _run(self) -> None:
        with RemoteNode(self._master_uri, self._node) as master:
            due_at = 0.0
            while not self._ending.wait(_FIRST_PERIOD_S):
                self._beside()
                if time.monotonic() >= due_at:
                    self.refresh(master)
                    # the launch file sets the model, the driver its description somewhat later
                    is_known = self._driver_parameter("model") and self._description()
                    due_at = time.monotonic() + (_PERIOD_S if is_known else _FIRST_PERIOD_S)

    def refresh(self, master: RemoteNode) -> None:
        """Ask for the parameters, read the model file; what is known stays where the master does not answer."""
        try:
            self._parameters = parameter_dump(master)
            self._asked_at = time.time()
        except JakaBagError:
            return
        self._model_file = self._read_model_file()

    def _read_model_file(self) -> Tuple[Optional[bytes], str]:
        path = self._driver_parameter("dh_file")
        if not isinstance(path, str) or not path:
            return None, ""
        try:
            return read_model_file(path), ""
        except BagError as error:
            return None, "dh_file (%s %s)" % (path, error)

    def _driver_parameter(self, name: str) -> Any:
        value: Any = json.loads(self._parameters or b"{}")
        for word in self._driver.strip("/").split("/") + [name]:
            value = value.get(word) if isinstance(value, dict) else None
        return value

    def _description(self) -> str:
        """Return the URDF from the driver's namespace, else from the root."""
        tree: Any = json.loads(self._parameters or b"{}")
        found = ""
        for word in [""] + self._driver.strip("/").split("/")[:-1]:
            tree = tree.get(word, {}) if word and isinstance(tree, dict) else tree
            text = tree.get("robot_description") if isinstance(tree, dict) else None
            found = text if isinstance(text, str) and text else found
        return found

    def attachments(self) -> List[Attachment]:
        """Return the attachments: parameters, URDF and DH parameters of the arm as far as they are known, versions."""
        items = [Attachment(PARAMETERS_NAME, self._parameters or b"{}\n", "application/yaml")]
        description = self._description()
        if description:
            items.append(Attachment("robot_description.urdf", description.encode("utf-8", "replace"),
                                    "application/xml"))
        for name, data in (("dh_file.yaml", self._model_file[0]), ("arm_models.yaml", self._models)):
            if data is not None:
                items.append(Attachment(name, data, "application/yaml"))
        items.append(Attachment("versions.json", self._versions, "application/json"))
        return items

    @staticmethod
    def _json(value: Any) -> bytes:
        return json.dumps(value, indent=1, sort_keys=True).encode() + b"\n"

    def last_attachment(self) -> Attachment:
        """Return the newest diagnostics, with the controller's event text, as the attachment for a file's end."""
        return Attachment("diagnostics.json", self._json(self._diagnostics()), "application/json")

    def facts(self) -> Dict[str, str]:
        """Return facts about host, clock, arm and versions, and a list of the evidence that is missing."""
        diagnostics = self._diagnostics()
        facts = {"host": platform.node(), "clock": clock_state(), "jaka_bag_version": __version__,
                 "python": sys.version.split()[0], "event": event_text(diagnostics),
                 "model": str(self._driver_parameter("model") or "")}
        for name, status in diagnostics.items():
            if name.endswith("versions"):
                for key, field in _VERSION_KEYS.items():
                    facts[field] = status["values"].get(key) or facts.get(field, "")
        names = {item.name for item in self.attachments()}
        missing = [words for words, there in (
            ("parameters (the master was never reached)", bool(self._asked_at)),
            ("URDF (robot_description is not set)", "robot_description.urdf" in names),
            ("DH parameters (the driver is not installed here)", bool(names & {"dh_file.yaml", "arm_models.yaml"})),
            ("controller version (no diagnostics came)", bool(facts.get("controller_version")))) if not there]
        missing += [self._model_file[1]] if self._model_file[1] else []
        if self._asked_at:
            facts["parameters_of"] = time.strftime("%Y-%m-%dT%H:%M:%S%z", time.localtime(self._asked_at))
        return dict({key: value for key, value in facts.items() if value}, missing="; ".join(missing) or "nothing")


def event_text(diagnostics: Dict[str, Dict[str, Any]]) -> str:
    """Return the text of the controller's event from the driver's diagnostics; empty where there is none."""
    for name, status in diagnostics.items():
        if name.endswith("controller state"):
            return str(status["values"].get("event") or "")
    return ""
