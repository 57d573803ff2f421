"""Tickets: what their bearer may be, signed with a key of the server's key file (protocol/README.md, "Tickets")."""

import base64
import hashlib
import hmac
import os
import secrets
import stat
import struct
from collections.abc import Mapping
from dataclasses import dataclass, field

from .errors import PalpateError

_LAYOUT = struct.Struct("<BBBbHQIIQ")
_VERSION = 1
_KEY_BYTES = 32
_TEXT = 83
_ROLES = ("viewer", "trainee", "instructor")
_TOOLS = range(-2, 32)


@dataclass(frozen=True)
class Ticket:
    """role: the highest that the bearer may have. tool: the only one, -1 any, -2 none. uses: how many members it
    admits, 0 any number. session: ticket_session() of the only one, 0 any. user: of the issuer's numbering, 0 nobody
    in particular. expires_s: Unix time after which it admits nobody, 0 never. nonce: tells tickets apart."""

    role: str = "trainee"
    tool: int = -1
    uses: int = 1
    session: int = 0
    user: int = 0
    expires_s: int = 0
    nonce: int = field(default_factory=lambda: secrets.randbits(64))


def ticket_session(name: str) -> int:
    """The number of a session in its tickets; "": any session, 0."""
    number = int.from_bytes(hashlib.sha256(name.encode()).digest()[:8], "little")
    return (number or 1) if name else 0


def _signature(data: bytes, key: bytes) -> bytes:
    if len(key) != _KEY_BYTES:
        raise PalpateError(f"a key of tickets has {len(key)} bytes instead of {_KEY_BYTES}")
    return hmac.new(key, data, "sha256").digest()


def write_ticket(ticket: Ticket, key_id: int, key: bytes) -> str:
    """The text of a ticket, 83 characters, signed with this key of 32 bytes; PalpateError when a number has no place
    in it."""
    if ticket.role not in _ROLES or ticket.tool not in _TOOLS:
        raise PalpateError(f"role {ticket.role} or tool {ticket.tool} of a ticket is out of range")
    numbers = (ticket.tool, ticket.uses, ticket.session, ticket.user, ticket.expires_s, ticket.nonce)
    try:
        data = _LAYOUT.pack(_VERSION, key_id, _ROLES.index(ticket.role), *numbers)
    except struct.error as error:
        raise PalpateError(f"a number of a ticket is out of its range: {error}") from error
    return base64.urlsafe_b64encode(data + _signature(data, key)).decode().rstrip("=")


def read_ticket(text: str, keys: Mapping[int, bytes]) -> Ticket:
    """The ticket of this text; PalpateError unless one of these keys has signed it. Whether it has expired, and for
    which session it is, the caller checks."""
    try:
        data = base64.b64decode(text + "=", altchars=b"-_", validate=True)
    except ValueError:
        data = b""
    if len(text) != _TEXT or len(data) != _LAYOUT.size + _KEY_BYTES:
        raise PalpateError("a ticket is not 83 characters of base64url")
    version, key_id, role, tool, uses, session, user, expires_s, nonce = _LAYOUT.unpack_from(data)
    if version != _VERSION or key_id not in keys:
        raise PalpateError("a ticket is of another version or key")
    if not hmac.compare_digest(_signature(data[: _LAYOUT.size], keys[key_id]), data[_LAYOUT.size :]):
        raise PalpateError("a ticket is not signed with its key")
    if role >= len(_ROLES) or tool not in _TOOLS:
        raise PalpateError("role or tool of a ticket is out of range")
    return Ticket(_ROLES[role], tool, uses, session, user, expires_s, nonce)


def read_keys(path: str | os.PathLike[str]) -> dict[int, bytes]:
    """The keys of a file of `palpate ticket --new-key` by their ids; the last one signs. PalpateError when a line is
    no key, or others than the owner may read it."""
    keys: dict[int, bytes] = {}
    try:
        with open(path, encoding="ascii") as file:
            if stat.S_IMODE(os.fstat(file.fileno()).st_mode) & 0o077:
                raise PalpateError(f"{os.fspath(path)} may be read or written by others than its owner")
            lines = file.read().splitlines()
    except (OSError, ValueError) as error:
        raise PalpateError(f"{os.fspath(path)} cannot be read: {error}") from error
    for number, line in enumerate(lines, 1):
        words = line.split()
        if not words or words[0].startswith("#"):
            continue
        try:
            key_id, key = int(words[0]), bytes.fromhex(words[1])
        except (ValueError, IndexError):
            key_id, key = 0, b""
        if len(words) != 2 or not 1 <= key_id <= 255 or len(key) != _KEY_BYTES or key_id in keys:
            raise PalpateError(f"{os.fspath(path)}: line {number} is not an id from 1 to 255 and 64 hexadecimal digits")
        keys[key_id] = key
    if not keys:
        raise PalpateError(f"{os.fspath(path)} has no key")
    return keys
