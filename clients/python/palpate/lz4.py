"""Decoder of the LZ4 block format for untrusted bytes. Without a library: what streams is small."""

from .errors import WireError


def _damaged() -> WireError:
    return WireError("LZ4", "a compressed block is damaged")


def _length(block: bytes, at: int, length: int) -> tuple[int, int]:
    """A length that a nibble of 15 begins: it goes on while bytes are 255."""
    while True:
        if at >= len(block):
            raise _damaged()
        length += block[at]
        at += 1
        if block[at - 1] != 255:
            return length, at


def expand(block: bytes, n_byte: int) -> bytes:
    """The n_byte bytes to which the whole block expands; WireError LZ4 when it expands to any other number."""
    out = bytearray()
    n, at = len(block), 0
    while True:
        if at >= n:
            raise _damaged()
        token = block[at]
        at += 1
        length = token >> 4
        if length == 15:
            length, at = _length(block, at, length)
        if length > n - at or length > n_byte - len(out):
            raise _damaged()
        out += block[at : at + length]
        at += length
        if at == n:
            break

        # a match: distance in two bytes, at least 4 bytes long; it may overlap what it writes
        if n - at < 2:
            raise _damaged()
        distance = block[at] | block[at + 1] << 8
        at += 2
        length = token & 15
        if length == 15:
            length, at = _length(block, at, length)
        length += 4
        begin = len(out) - distance
        if distance == 0 or begin < 0 or length > n_byte - len(out):
            raise _damaged()
        if distance >= length:
            out += out[begin : begin + length]
        else:
            out += (out[begin:] * (length // distance + 1))[:length]
    if len(out) != n_byte:
        raise _damaged()
    return bytes(out)
