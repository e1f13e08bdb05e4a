"""Protobuf messages as those of ROS 1, by the descriptors that a log holds and the library protobuf.

What may be missing (``optional``, messages) is as in ``json_types``; an enumeration is its number, a map is JSON in a
text.
"""
import base64
import importlib
import json
from typing import Any, Dict, Set

from ..errors import DefinitionError, MissingDependency
from .json_types import JsonType

_TYPE_BYTES, _LABEL_REPEATED = 12, 3
_SIMPLE = {1: "integer", 2: "integer", 3: "integer", 4: "integer", 5: "number", 6: "number", 7: "boolean",
           8: "integer", 9: "string"}
"""Types of JSON by the number of a field's C++ type."""


def _is_repeated(field: Any) -> bool:
    """Return whether a field is a list or a map; newer versions of protobuf have no ``label``."""
    return bool(field.is_repeated if hasattr(field, "is_repeated") else field.label == _LABEL_REPEATED)


def _is_map(field: Any) -> bool:
    return field.message_type is not None and bool(field.message_type.GetOptions().map_entry)


class ProtobufType:
    """The ROS 1 form of a Protobuf type.

    Args:
        name: Full name of the message.
        descriptors: Serialised ``FileDescriptorSet`` with all that the message needs.

    Attributes:
        name: ``package/Type``.
        definition: ROS 1 definition text with those of all types in it.

    Raises:
        DefinitionError: The descriptors cannot be read, or lack the message.
        MissingDependency: protobuf is not installed.
    """

    def __init__(self, name: str, descriptors: bytes) -> None:
        try:
            pool_module, file_types, factory = (importlib.import_module("google.protobuf." + part) for part in (
                "descriptor_pool", "descriptor_pb2", "message_factory"))
        except ImportError:
            raise MissingDependency("messages of Protobuf need the Python package protobuf") from None
        self._schemas: Dict[str, Any] = {}
        try:
            pool = pool_module.DescriptorPool()
            files = {file.name: file for file in file_types.FileDescriptorSet.FromString(descriptors).file}
            added: Set[str] = set()
            waiting = list(files)
            while waiting:  # a file comes behind those that it needs
                file = files[waiting[-1]]
                missing = [needed for needed in file.dependency if needed in files and needed not in added]
                if file.name in added or not missing:
                    waiting.pop()
                    if file.name not in added:
                        pool.Add(file)
                    added.add(file.name)
                elif len(waiting) > 10 * len(files) + 10:
                    raise DefinitionError("its files need each other")
                else:
                    waiting += missing
            descriptor = pool.FindMessageTypeByName(name)
            self._message: Any = factory.GetMessageClass(descriptor) if hasattr(
                factory, "GetMessageClass") else factory.MessageFactory(pool).GetPrototype(descriptor)
            self._schema(descriptor)
        except (DefinitionError, MissingDependency):
            raise
        except Exception as error:  # DecodeError, KeyError, TypeError: whatever the library meets
            text = str(error.args[0] if isinstance(error, KeyError) and error.args else error)  # its text is a repr
            raise DefinitionError("the descriptors of %s cannot be read (%s)" % (name, text[:160])) from error
        self._json = JsonType(name, json.dumps({
            "$ref": "#/definitions/" + name, "definitions": self._schemas}), "protobuf")
        self.name, self.definition = self._json.name, self._json.definition

    def _schema(self, descriptor: Any) -> None:
        """Add the JSON Schema of a message, and of the messages in it, by their names."""
        self._schemas[descriptor.full_name] = {}
        found: Dict[str, Any] = {"type": "object", "properties": {}, "required": []}
        for field in descriptor.fields:
            kind: Dict[str, Any] = {"type": _SIMPLE.get(field.cpp_type)}
            if _is_map(field):
                kind = {}
            elif field.message_type is not None:
                if field.message_type.full_name not in self._schemas:
                    self._schema(field.message_type)
                kind = {"$ref": "#/definitions/" + field.message_type.full_name}
            elif field.type == _TYPE_BYTES:
                kind["contentEncoding"] = "base64"
            found["properties"][field.name] = {
                "type": "array", "items": kind} if _is_repeated(field) and not _is_map(field) else kind
            if not field.has_presence:
                found["required"].append(field.name)
        self._schemas[descriptor.full_name] = found

    def to_ros1(self, message: bytes) -> bytes:
        """Convert a message.

        Raises:
            DefinitionError: It is none of this type.
        """
        try:
            return self._json.write(_value(self._message.FromString(message)))
        except DefinitionError:
            raise
        except Exception as error:  # DecodeError: whatever the library meets
            raise DefinitionError("a message of %s cannot be read (%s)" % (self.name, str(error)[:160])) from error


def _value(message: Any) -> Any:
    """Return a message as data of JSON; None for what is missing in it."""
    if not hasattr(message, "DESCRIPTOR"):
        return base64.b64encode(message).decode("ascii") if isinstance(message, bytes) else message
    found: Dict[str, Any] = {}
    for field in message.DESCRIPTOR.fields:
        value = getattr(message, field.name)
        if _is_map(field):
            found[field.name] = {str(key): _value(value[key]) for key in value}
        elif _is_repeated(field):
            found[field.name] = [_value(one) for one in value]
        else:
            found[field.name] = _value(value) if not field.has_presence or message.HasField(field.name) else None
    return found
