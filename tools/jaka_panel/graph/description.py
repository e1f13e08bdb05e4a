"""The parts of an arm's URDF that pages need: limits of its joints, and the files of its meshes."""
import hashlib
import math
import os
import re
import subprocess
import sys
from typing import Any, Dict, List, Optional
from urllib.parse import unquote, urlsplit
from xml.etree import ElementTree

import rospkg

from jaka_regression import command_lines

_JOINT = re.compile(r"joint_[1-6]\Z")
_TEXTURES = (".png", ".jpg", ".jpeg", ".bmp", ".tga")
_MESHES = (".stl", ".dae", ".obj", ".mtl", ".gltf", ".glb", ".bin")
_LARGEST = 100 * 1024 * 1024
"""Largest file of a robot's description, byte, that pages get: meshes have some MB."""
_URDF_TIMEOUT_S = 20.0
"""Longest wait, s, for the URDF of a model, made by a process that imports ROS."""


class Description:
    """A URDF.

    Attributes:
        text: The URDF's text.
        fingerprint: A short text that changes with it.
        joints: Limits of ``joint_1`` to ``joint_6`` as JSON has them, None where it lacks some of them.
    """

    def __init__(self, text: str) -> None:
        """Read it; a text that is no XML has no joints and no meshes."""
        self.text = text
        self.fingerprint = hashlib.sha256(text.encode("utf-8", "replace")).hexdigest()[:16]
        try:
            # entities would be expanded without a limit; a URDF has none
            root = None if "<!DOCTYPE" in text or "<!ENTITY" in text else ElementTree.fromstring(text)
        except ElementTree.ParseError:
            root = None
        self.joints = None if root is None else _joints(root)
        self._meshes = set() if root is None else {
            mesh.get("filename", "") for mesh in root.iter("mesh")}

    def mesh_file(self, uri: str) -> Optional[str]:
        """Return the file of a mesh that the URDF names, or of a texture in a mesh's folder; None for all others."""
        if uri in self._meshes:
            return _existing(_path(uri), _MESHES)
        folder, _, name = uri.rpartition("/")
        if "/" in name or name in ("", "..") or not any(mesh.rpartition("/")[0] == folder for mesh in self._meshes):
            return None
        return _existing(_path(uri), _TEXTURES + (".mtl", ".bin"))


def _path(uri: str) -> Optional[str]:
    """Return the path that a URI names; None if it is of another kind or its package is unknown."""
    try:
        parts = urlsplit(uri)
    except ValueError:
        return None
    if parts.scheme == "file":
        return unquote(parts.path)
    if parts.scheme != "package":
        return None
    try:
        root = os.path.realpath(rospkg.RosPack().get_path(parts.netloc))
    except rospkg.ResourceNotFound:
        return None
    path = os.path.realpath(os.path.join(root, unquote(parts.path).lstrip("/")))
    return path if path.startswith(root + os.sep) else None


def _existing(path: Optional[str], suffixes: Any) -> Optional[str]:
    if path is None or not path.lower().endswith(suffixes) or not os.path.isfile(path):
        return None
    return path if os.path.getsize(path) <= _LARGEST else None


def _joints(root: ElementTree.Element) -> Optional[List[Dict[str, Any]]]:
    found: Dict[str, Dict[str, Any]] = {}
    for joint in root.iter("joint"):
        name, limit = joint.get("name", ""), joint.find("limit")
        match = _JOINT.search(name)
        if match is None or limit is None:
            continue
        try:
            values = {key: float(limit.get(key, "")) for key in ("lower", "upper", "velocity")}
        except ValueError:
            continue
        if all(map(math.isfinite, values.values())):
            found[match.group()] = {"name": name, **values}
    return [found[name] for name in sorted(found)] if len(found) == 6 else None


def generated(model: str, dh_file: str, prefix: str) -> str:
    """Return the URDF that the driver generates for a model; empty if it generates none."""
    if model.startswith("-") or dh_file.startswith("-") or prefix.startswith("-"):
        return ""
    words = [sys.executable, *command_lines.DRIVER, "--urdf", model, "--dh-file", dh_file, "--frame-prefix", prefix]
    try:
        done = subprocess.run(words, capture_output=True, text=True, timeout=_URDF_TIMEOUT_S)
    except (OSError, subprocess.TimeoutExpired):
        return ""
    return done.stdout if done.returncode == 0 else ""
