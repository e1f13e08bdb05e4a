"""The signature of a finished log, which shows a changed byte and the record it lies in (Ed25519, RFC 8032).

The signature is a file of its own beside the log, ``NAME.sig``: every record of the log with its SHA-256, and a
signature over all of them. It covers each byte of the log, its index at the end included.

Functions that need the package ``cryptography`` raise ``MissingDependency`` where it is not installed.
"""
import base64
import hashlib
import json
import os
import time
from pathlib import Path
from typing import Any, BinaryIO, Dict, List, NamedTuple, Optional, Tuple

from ..containers.index import open_for_reading
from ..containers.registry import file_pieces
from ..errors import BagError, MissingDependency, UsageError
from ..json_text import load_json
from ..output_file import OutputFile
from ..paths import PathLike

SUFFIX = ".sig"
_FORMAT = "jaka_bag signature 1"
_BLOCK = 1 << 20
"""Bytes hashed at a time: memory stays bounded."""
_MOST_TEXT = 1 << 28
"""Longest signature, byte, that is read: that of a log of 2 TB, with 120 bytes for each MB."""


class Verification(NamedTuple):
    """The result of a signature's verification.

    Attributes:
        problems: Changes, in words; empty where there are none.
        signer: SHA-256 of the public key, hex, its first 16 digits.
        is_trusted: Signed with the key that was given; None where none was.
        signed_at: Time of the signature, by the signer's clock.
    """

    problems: Tuple[str, ...]
    signer: str
    is_trusted: Optional[bool]
    signed_at: str


def _cryptography() -> Tuple[Any, Any]:
    """Import the modules for keys and for Ed25519."""
    try:
        from cryptography.hazmat.primitives import serialization
        from cryptography.hazmat.primitives.asymmetric import ed25519
    except ImportError:
        raise MissingDependency("signatures need the Python package cryptography: pip install cryptography") from None
    return serialization, ed25519


def load_private_key(path: PathLike) -> Any:
    """Load an Ed25519 private key from a PEM file (``openssl genpkey -algorithm ed25519``).

    Raises:
        UsageError: The file cannot be read, or holds no such key.
    """
    serialization, ed25519 = _cryptography()
    try:
        key = serialization.load_pem_private_key(Path(path).read_bytes(), None)
    except OSError as error:
        raise UsageError("cannot read the key %s: %s" % (path, error.strerror)) from error
    except (ValueError, TypeError) as error:
        raise UsageError("%s is no private key in PEM without a password: %s" % (path, error)) from error
    if not isinstance(key, ed25519.Ed25519PrivateKey):
        raise UsageError("%s is no Ed25519 key (openssl genpkey -algorithm ed25519)" % path)
    return key


def load_public_key(path: PathLike) -> bytes:
    """Load the 32 bytes of an Ed25519 public key from a PEM file (``openssl pkey -pubout``).

    Raises:
        UsageError: The file cannot be read, or holds no such key.
    """
    serialization, ed25519 = _cryptography()
    try:
        key = serialization.load_pem_public_key(Path(path).read_bytes())
    except OSError as error:
        raise UsageError("cannot read the key %s: %s" % (path, error.strerror)) from error
    except ValueError as error:
        raise UsageError("%s is no public key in PEM: %s" % (path, error)) from error
    if not isinstance(key, ed25519.Ed25519PublicKey):
        raise UsageError("%s is no Ed25519 key" % path)
    return _raw(key)


def _raw(public_key: Any) -> bytes:
    serialization, _ = _cryptography()
    raw: bytes = public_key.public_bytes(serialization.Encoding.Raw, serialization.PublicFormat.Raw)
    return raw


def _digest(file: BinaryIO, at: int, size: int) -> str:
    digest = hashlib.sha256()
    file.seek(at)
    while size > 0:
        piece = file.read(min(size, _BLOCK))
        if not piece:
            break
        digest.update(piece)
        size -= len(piece)
    return digest.hexdigest()


def _signed_bytes(document: Dict[str, Any]) -> bytes:
    """Return the bytes that are signed: all of the document but the signature, in one form."""
    plain = {key: value for key, value in document.items() if key != "signature"}
    return json.dumps(plain, sort_keys=True, separators=(",", ":")).encode()


def sign(path: PathLike, key: Any) -> Path:
    """Write the signature of a finished log beside it; an older one is replaced.

    Args:
        path: The log.
        key: Key from ``load_private_key``.

    Raises:
        BagError: The log cannot be read or the signature not be written.
    """
    target = Path(str(path) + SUFFIX)
    with open_for_reading(path) as file:
        pieces: List[List[Any]] = []
        for at, size, what in list(file_pieces(file)):
            pieces.append([at, size, what, _digest(file, at, size)])
        document = {"format": _FORMAT, "algorithm": "Ed25519", "file": Path(path).name,
                    "size": os.fstat(file.fileno()).st_size, "signed_at": time.strftime("%Y-%m-%dT%H:%M:%S%z"),
                    "public_key": base64.b64encode(_raw(key.public_key())).decode(), "pieces": pieces}
    document["signature"] = base64.b64encode(key.sign(_signed_bytes(document))).decode()
    with OutputFile(target, overwrite=True) as output:
        try:
            output.write(json.dumps(document, indent=0).encode() + b"\n")
        except OSError as error:
            raise BagError("cannot write %s: %s" % (target, error.strerror)) from error
    return target


def _read_document(path: Path) -> Dict[str, Any]:
    if not path.exists():
        raise BagError("there is no signature %s" % path)
    with open_for_reading(path) as file:
        raw = file.read(_MOST_TEXT)
    try:
        document = load_json(raw)
        if document["format"] != _FORMAT:
            raise ValueError("of another kind")
        base64.b64decode(document["public_key"], validate=True)
        base64.b64decode(document["signature"], validate=True)
        for at, size, what, digest in document["pieces"]:
            if [type(value) for value in (at, size, what, digest)] != [int, int, str, str]:
                raise ValueError("its list of records")
    except (ValueError, TypeError, KeyError) as error:
        raise BagError("%s is no signature that is understood, or was changed: %s" % (path, error)) from error
    return dict(document)


def verify(path: PathLike, trusted: Optional[bytes] = None, signature: Optional[PathLike] = None) -> Verification:
    """Compare a log with its signature.

    Args:
        path: The log.
        trusted: The public key that it ought to be signed with, from ``load_public_key``; None for any.
        signature: The signature's file; None for ``NAME.sig``.

    Raises:
        BagError: There is no signature, it is not understood, or the log cannot be read.
    """
    _, ed25519 = _cryptography()
    from cryptography.exceptions import InvalidSignature

    where = Path(str(path) + SUFFIX) if signature is None else Path(signature)
    document = _read_document(where)
    raw_key = base64.b64decode(document["public_key"])
    problems: List[str] = []
    try:
        ed25519.Ed25519PublicKey.from_public_bytes(raw_key).verify(
            base64.b64decode(document["signature"]), _signed_bytes(document))
    except (InvalidSignature, ValueError):
        problems.append("the signature %s itself was changed: it does not fit its key" % where)
    with open_for_reading(path) as file:
        size = os.fstat(file.fileno()).st_size
        if size != document["size"]:
            problems.append("it has %d bytes, signed were %s" % (size, document["size"]))
        expected = 0
        for at, length, what, digest in document["pieces"]:
            if at != expected:
                problems.append("bytes %d to %d are not covered by the signature" % (expected, at))
            expected = at + length
            if _digest(file, at, length) != digest:
                problems.append("bytes %d to %d were changed: %s" % (at, at + length - 1, what))
        if expected < size:
            problems.append("bytes %d to %d were not signed" % (expected, size - 1))
    return Verification(tuple(problems), hashlib.sha256(raw_key).hexdigest()[:16],
                        None if trusted is None else raw_key == trusted, str(document.get("signed_at", "")))
