"""Control messages: JSON objects (protocol/README.md, "Control")."""

import json
from typing import Any

from .errors import WireError, need

Message = dict[str, Any]


def _no_constant(name: str) -> None:
    raise ValueError(f"{name} is no JSON")


def read_control(text: str) -> Message:
    """A text message of the server; WireError JSON when it is no object with a `type`."""
    try:
        message = json.loads(text, parse_constant=_no_constant)
    except (ValueError, RecursionError) as error:
        raise WireError("JSON", "a text message is not JSON") from error
    typed = isinstance(message, dict) and isinstance(message.get("type"), str)
    need(typed, "JSON", "a text message is no object with a type")
    object_of: Message = message
    return object_of


def whole(message: Message, key: str) -> int:
    """A whole number from 0 below 2^53, which may be written as 4e+09."""
    value: Any = message.get(key)
    good = type(value) in (int, float) and 0 <= value < 2**53 and value == int(value)
    need(good, "JSON", f"a message has no whole number {key}")
    return int(value)


def text_of(message: Message, key: str) -> str:
    """A string."""
    value = message.get(key)
    need(isinstance(value, str), "JSON", f"a message has no string {key}")
    return str(value)


def objects(message: Message, key: str) -> list[Message]:
    """A list of objects; absent is none."""
    value = message.get(key, [])
    good = isinstance(value, list) and all(isinstance(item, dict) for item in value)
    need(good, "JSON", f"{key} of a message is no list of objects")
    return list(value)
