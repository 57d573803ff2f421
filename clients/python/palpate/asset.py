"""Assets: rest pose, triangles, wire order and predictor of one part (protocol/README.md, "Assets")."""

import struct
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from . import lz4
from .errors import need
from .planes import U32, planes, running_sum, unfold
from .wire import VERTEX_MAX

_HEAD = struct.Struct("<4s9I")
_BYTES_MAX = 1 << 28
_TRIANGLE_MAX = 1 << 24
_LEVEL_MAX = 4096
_ONE = 4096  # sum of the weights of a predicted vertex
_ABS_MAX = 8191  # largest sum of their sizes


@dataclass(frozen=True)
class Asset:
    """What a part is at rest.

    rest_m [n][3] float32 and triangles [t][3] uint32 are in vertex order; a slot of an adaptive part that is empty is
    0 0 0. look [n] uint8: 0 outside of tissue, 1 inside, 2 + k image k; uv [n][2] float32: image coordinates from the
    lower left corner; both None where the asset has no looks. vertex_of [n], neighbour [n][4] and weight [n][4] are the
    wire order and predictor of frames, levels [l] the first wire index of each level.
    """

    rest_m: NDArray[np.float32]
    triangles: U32
    vertex_of: U32
    neighbour: U32
    weight: NDArray[np.int16]
    levels: U32
    look: NDArray[np.uint8] | None
    uv: NDArray[np.float32] | None


def _fnv1a(block: bytes) -> int:
    value = 0x811C9DC5
    for byte in block:
        value = (value ^ byte) * 16777619 & 0xFFFFFFFF
    return value


def _read_head(data: bytes) -> tuple[int, int, int, int, bool]:
    """n, triangles, levels, raw length, has looks: checked against one another and the bytes that are there."""
    need(len(data) >= _HEAD.size, "SHORT", "an asset has no head")
    magic, version, n, n_triangle, n_level, n_raw, n_lz4, checksum, zero, zero2 = _HEAD.unpack_from(data)
    need(magic == b"PLM1", "MAGIC", "an asset does not begin with PLM1")
    need(version in (1, 2), "KIND", f"an asset has version {version}, this package reads 1 and 2")
    need(zero == zero2 == 0, "FLAGS", "reserved numbers of an asset are not 0")
    counts = 0 < n <= VERTEX_MAX and n_triangle <= _TRIANGLE_MAX and 0 < n_level <= min(_LEVEL_MAX, n)
    need(counts, "COUNT", "counts of an asset are out of range")
    size = (49 if version == 2 else 40) * n + 12 * n_triangle + 4 * n_level
    need(size == n_raw and n_raw <= _BYTES_MAX, "COUNT", "counts of an asset do not fit its length")
    need(n_lz4 <= len(data) - _HEAD.size, "SHORT", "an asset is cut short")
    need(n_lz4 >= len(data) - _HEAD.size, "LONG", "there are bytes behind the end of an asset")
    need(n_raw // 255 <= n_lz4, "COUNT", "an asset states more than its bytes can hold")
    need(_fnv1a(data[_HEAD.size :]) == checksum, "CHECKSUM", "the checksum of an asset does not match")
    return n, n_triangle, n_level, n_raw, version == 2


def _floats(raw: NDArray[np.uint8], at: int, n: int, n_column: int) -> NDArray[np.float32]:
    columns = [planes(raw, at + 4 * n * c, n).view(np.float32) for c in range(n_column)]
    return np.stack(columns, axis=1)


def _check(asset: Asset) -> None:
    n = len(asset.rest_m)
    need(np.isfinite(asset.rest_m).all(), "NAN", "a rest position of an asset is not finite")
    need(asset.uv is None or np.isfinite(asset.uv).all(), "NAN", "an image coordinate of an asset is not finite")
    need((asset.triangles < n).all(), "RANGE", "a triangle of an asset names no vertex")
    levels = asset.levels.astype(np.int64)
    need(levels[0] == 0 and (np.diff(levels) > 0).all() and levels[-1] < n, "ORDER", "levels of an asset do not grow")
    in_range = (asset.vertex_of < n).all()
    need(in_range and np.bincount(asset.vertex_of, minlength=n).max() == 1, "ORDER", "the wire order is no permutation")
    weight = asset.weight.astype(np.int64)
    total, size = weight.sum(axis=1), np.abs(weight).sum(axis=1)
    need(((total == _ONE) | (size == 0)).all() and (size <= _ABS_MAX).all(), "ORDER", "weights of an asset are off")
    before = np.where(weight != 0, asset.neighbour < np.arange(n)[:, None], asset.neighbour == 0)
    need(before.all(), "ORDER", "a vertex of an asset is predicted from later ones")


def decode_asset(data: bytes) -> Asset:
    """The whole file that a part's `asset` names; WireError when any of it cannot be trusted."""
    n, n_triangle, n_level, n_raw, has_look = _read_head(data)
    raw = np.frombuffer(lz4.expand(data[_HEAD.size :], n_raw), dtype=np.uint8)
    rest = _floats(raw, 0, n, 3)
    vertex_of = running_sum(unfold(planes(raw, 12 * n, n)))
    neighbour = np.empty((n, 4), dtype=np.uint32)
    before = np.arange(n, dtype=np.uint32)
    for j in range(4):
        before = neighbour[:, j] = unfold(planes(raw, (16 + 4 * j) * n, n)) + before
    weights = [planes(raw, (32 + 2 * j) * n, n, 2).astype(np.uint16).view(np.int16) for j in range(4)]
    at = 40 * n
    corners = unfold(planes(raw, at, 3 * n_triangle)).reshape(n_triangle, 3)
    at += 12 * n_triangle
    levels = planes(raw, at, n_level)
    at += 4 * n_level
    asset = Asset(
        rest,
        running_sum(corners),
        vertex_of,
        neighbour,
        np.stack(weights, axis=1),
        levels,
        raw[at + 8 * n :].copy() if has_look else None,
        _floats(raw, at, n, 2) if has_look else None,
    )
    _check(asset)
    return asset
