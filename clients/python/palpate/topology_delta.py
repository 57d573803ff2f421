"""TOPOLOGY_DELTA messages (protocol/README.md): changed slots of the triangle table of an adaptive part."""

import struct
from dataclasses import dataclass

import numpy as np

from . import lz4, wire
from .errors import need
from .planes import U32, planes, running_sum, unfold

_HEAD = struct.Struct("<IIQ II")
_HEAD_BYTES = 32
_SLOT_MAX = 1 << 22


@dataclass(frozen=True)
class TopologyDelta:
    """slots [k] uint32, ascending, and their triangles [k][3] uint32 now, 0 0 0 empty. revision: of the table that
    results. To apply it: table[delta.slots] = delta.triangles."""

    part: int
    epoch: int
    revision: int
    slots: U32
    triangles: U32


def decode_topology_delta(data: bytes, n_slot: int, n_vertex: int) -> TopologyDelta:
    """A TOPOLOGY_DELTA message for a table of n_slot triangles over n_vertex vertices; WireError when it is none."""
    _, part = wire.read_head_of(data, wire.TOPOLOGY_DELTA, 0, _HEAD_BYTES)
    epoch, n, revision, n_raw, n_lz4 = _HEAD.unpack_from(data, 8)
    block = wire.need_block(data, _HEAD_BYTES, n_lz4)
    need(part < wire.PART_MAX and revision < 1 << 53, "RANGE", "part or revision of a change are out of range")
    need(0 < n <= min(_SLOT_MAX, n_slot) and n_raw == 16 * n, "COUNT", f"a change has {n} slots in {n_raw} bytes")
    need(n_raw // 255 <= n_lz4, "COUNT", "a change states more than its bytes can hold")
    raw = np.frombuffer(lz4.expand(block, n_raw), dtype=np.uint8)
    slots = running_sum(unfold(planes(raw, 0, n)))
    triangles = running_sum(unfold(planes(raw, 4 * n, 3 * n)).reshape(n, 3))
    ascend = (np.diff(slots.astype(np.int64)) > 0).all() and (slots < n_slot).all()
    need(ascend, "RANGE", "slots of a change do not ascend within the table")
    need((triangles < n_vertex).all(), "RANGE", "a triangle of a change names no vertex")
    return TopologyDelta(part, epoch, revision, slots, triangles)
