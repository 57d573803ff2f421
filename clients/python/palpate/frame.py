"""FRAME messages (protocol/README.md, "FRAME"): the same numbers as protocol/frame_codec.c, to the bit.

Codes are of different lengths, so that their places are found one after the other; all else is done on whole arrays:
values of codes, and predictions of all vertices whose neighbours are known.
"""

import struct
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from . import lz4, wire
from .asset import Asset
from .errors import need

_HEAD = struct.Struct("<IIQ I f III")
_HEAD_BYTES = 44
_AFFINE_BYTES = 48
_GROUP = 16
_QUOTIENT_MAX = 12  # zeros that announce an escape
_ESCAPE_BITS = 24
_ESCAPE_LENGTH = _QUOTIENT_MAX + 1 + _ESCAPE_BITS
_MODE_MASK = 7  # modes 7..13: a mask says which vertices have codes
_MODE_WIDE = 14  # k in the next 4 bits
_MODE_ZERO = 15  # no codes
_TAIL = 8  # zero bytes behind the codes
_SLACK = 256  # zero bytes behind those: a group is read past the end before that is noticed
_X_LIMIT = 1 << 18

# bits of a code by k and the zeros before its first 1; one zero too many is refused later
_BITS = [bytes([*(z + 1 + k for z in range(_QUOTIENT_MAX)), _ESCAPE_LENGTH, _ESCAPE_LENGTH]) for k in range(16)]


@dataclass(frozen=True)
class Frame:
    """The shape of one part at one moment.

    positions_m [n][3] float32 in vertex order, own memory. epoch: the asset it belongs to; seq grows from frame to
    frame of a part; sim_time_us: simulated time; q_m: quantisation step, from which each coordinate is at most
    q_m (1 + 1/16 + 1/64) / 2 off. A vertex in no present triangle of an adaptive part means nothing.
    """

    part: int
    epoch: int
    seq: int
    cycle: int
    sim_time_us: int
    q_m: float
    positions_m: NDArray[np.float32]


def epoch_of(data: bytes) -> tuple[int, int]:
    """Part and epoch of a FRAME, FIELD or TOPOLOGY_DELTA message with a valid head."""
    _, _, index = wire.read_head(data)
    need(len(data) >= 12 and index < wire.PART_MAX, "RANGE", "a message is of no part")
    return index, int.from_bytes(data[8:12], "little")


def _mode_bytes(n: int) -> int:
    return (-(-n // _GROUP) + 1) // 2


def _raw_bound(n: int) -> int:
    return _mode_bytes(n) + (3 * n * _ESCAPE_LENGTH + 7) // 8 + 2 * -(-n // _GROUP) + _TAIL


def _batches(neighbour: NDArray[np.int64], weight: NDArray[np.int32]) -> list[tuple[int, int]]:
    """Ranges of the wire order whose vertices are predicted from earlier ranges alone."""
    n = len(neighbour)
    newest = np.where(weight != 0, neighbour, -1).max(axis=1)
    ranges, begin = [], 0
    while begin < n:
        end, window = begin + 1, 64
        while end < n:
            late = newest[end : end + window] >= begin
            if late.any():
                end += int(late.argmax())
                break
            end, window = min(n, end + window), 2 * window
        ranges.append((begin, end))
        begin = end
    return ranges


def _residuals(raw: bytes, n: int) -> NDArray[np.int32]:
    """Residuals [n][3] in wire order."""
    n_mode = _mode_bytes(n)
    pairs = np.frombuffer(raw, dtype=np.uint8, count=n_mode)
    modes = np.stack((pairs & 15, pairs >> 4), axis=1).ravel()[: -(-n // _GROUP)]
    out = np.zeros((n, 3), dtype=np.int32)
    n_bit = 8 * (len(raw) - n_mode - _TAIL)
    busy = np.flatnonzero(modes != _MODE_ZERO)
    if len(busy) == 0:
        need(n_bit == 0, "COUNT", "the codes of a frame end before its body")
        return out

    # zeros before the next 1, from every bit
    codes = np.frombuffer(raw + bytes(_SLACK), dtype=np.uint8, offset=n_mode)
    bits = np.unpackbits(codes, bitorder="little")
    place = np.arange(len(bits), dtype=np.int64)
    following = np.minimum.accumulate(np.where(bits, place, len(bits) + _QUOTIENT_MAX + 1)[::-1])[::-1]
    quotients = np.minimum(following - place, _QUOTIENT_MAX + 1).astype(np.uint8)
    at, k_of, coded = _find_codes(modes, busy.tolist(), bits, quotients.tobytes(), n, n_bit)

    quotient = quotients[at].astype(np.int64)
    need((quotient <= _QUOTIENT_MAX).all(), "COUNT", "a frame has a code that is none")
    escape = quotient == _QUOTIENT_MAX
    k = np.where(escape, _ESCAPE_BITS, k_of)
    first = at + quotient + 1
    byte = first >> 3
    word = sum(codes[byte + i].astype(np.int64) << 8 * i for i in range(4))
    value = word >> (first & 7) & (np.int64(1) << k) - 1
    value += np.where(escape, 0, quotient << k)
    out[coded] = (value >> 1 ^ -(value & 1)).reshape(-1, 3)
    return out


def _find_codes(
    modes: NDArray[np.uint8], busy: list[int], bits: NDArray[np.uint8], quotients: bytes, n: int, n_bit: int
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.bool_]]:
    """Bit at which each code begins, its k, and the vertices that have codes, in wire order."""
    coded = np.zeros(n, dtype=np.bool_)
    at: list[int] = []
    k_of_group: list[int] = []
    n_of_group: list[int] = []
    bit = 0
    for group in busy:
        k = int(modes[group])
        begin = _GROUP * group
        n_here = min(_GROUP, n - begin)
        if k == _MODE_WIDE:
            k = sum(int(bits[bit + i]) << i for i in range(4))
            coded[begin : begin + n_here] = True
            n_code, bit = 3 * n_here, bit + 4
        elif k >= _MODE_MASK:
            k -= _MODE_MASK
            mask = bits[bit : bit + n_here]
            coded[begin : begin + n_here] = mask
            n_code, bit = 3 * int(mask.sum()), bit + n_here
        else:
            coded[begin : begin + n_here] = True
            n_code = 3 * n_here
        length = _BITS[k]
        for _ in range(n_code):
            at.append(bit)
            bit += length[quotients[bit]]
        need(bit <= n_bit, "COUNT", "the codes of a frame do not fit its body")
        k_of_group.append(k)
        n_of_group.append(n_code)
    need((bit + 7) // 8 * 8 == n_bit, "COUNT", "the codes of a frame end before its body")
    return np.array(at, dtype=np.int64), np.repeat(np.array(k_of_group, dtype=np.int64), n_of_group), coded


class FrameDecoder:
    """Decoder of the frames of one asset. Frames stand alone: any may be left out."""

    def __init__(self, asset: Asset) -> None:
        self._vertex_of = asset.vertex_of.astype(np.int64)
        self._rest = asset.rest_m[self._vertex_of].astype(np.float64)
        neighbour, weight = asset.neighbour.astype(np.int64), asset.weight.astype(np.int32)
        self._batches = [(a, b, neighbour[a:b], weight[a:b, :, None]) for a, b in _batches(neighbour, weight)]

    def decode(self, data: bytes) -> Frame:
        """One FRAME message of this asset; WireError when it is none."""
        flags, part = wire.read_head_of(data, wire.FRAME, 1, _HEAD_BYTES)
        at = _HEAD_BYTES + (_AFFINE_BYTES if flags else 0)
        need(len(data) >= at, "SHORT", "a frame has no room for its affine map")
        epoch, seq, sim_time_us, cycle, q, n, n_raw, n_lz4 = _HEAD.unpack_from(data, 8)
        block = wire.need_block(data, at, n_lz4)
        need(part < wire.PART_MAX and sim_time_us < 1 << 53, "RANGE", "part or time of a frame are out of range")
        wire.finite([q])
        need(q > 0, "RANGE", "the step of a frame is not above 0")
        need(n == len(self._rest), "COUNT", f"a frame has {n} vertices, its asset has {len(self._rest)}")
        fits = _mode_bytes(n) + _TAIL <= n_raw <= _raw_bound(n)
        need(fits, "COUNT", f"a frame has a body of {n_raw} bytes")
        x = self._predict(_residuals(lz4.expand(block, n_raw), n))
        with np.errstate(over="ignore", invalid="ignore"):
            position = self._rest + x * (q / 16)
            if flags:
                affine = struct.unpack_from("<12f", data, _HEAD_BYTES)
                wire.finite(affine)
                px, py, pz = position.T
                rows = [affine[i : i + 4] for i in (0, 4, 8)]
                position = np.stack([a * px + b * py + c * pz + d for a, b, c, d in rows], axis=1)
            out = np.empty((n, 3), dtype=np.float32)
            out[self._vertex_of] = position
        return Frame(part, epoch, seq, cycle, sim_time_us, q, out)

    def _predict(self, residual: NDArray[np.int32]) -> NDArray[np.int32]:
        """X [n][3]. Within its range every sum fits 32 bits, so the range is checked before X is used."""
        x = np.zeros_like(residual)
        for begin, end, neighbour, weight in self._batches:
            now = (((x[neighbour] * weight).sum(axis=1, dtype=np.int32) + 2048) >> 12) + 16 * residual[begin:end]
            need(np.abs(now).max() < _X_LIMIT, "RANGE", "a displacement of a frame is out of range")
            x[begin:end] = now
        return x
