"""INTERIOR messages (protocol/README.md, "INTERIOR"): displacements and values at the nodes inside a part."""

import struct
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from . import lz4, wire
from .errors import need
from .field import FIELD_NAMES, Levels
from .planes import U32

_HEAD = struct.Struct("<IIQ fff II")
_HEAD_BYTES = 44
_NODE_BYTES = 7
_Q_MAX = 1e30  # m: steps of it stay finite floats


@dataclass(frozen=True)
class Interior(Levels):
    """Values and displacements at the nodes inside a part, in the order of the interior's asset.

    displacement_m [n][3] float32, at most q_m / 2 off in each coordinate.
    """

    q_m: float
    displacement_m: NDArray[np.float32]


def decode_interior(data: bytes, n_node: int) -> Interior:
    """An INTERIOR message of an interior's asset with n_node nodes; WireError when it is none."""
    _, part = wire.read_head_of(data, wire.INTERIOR, 0, _HEAD_BYTES)
    epoch, number, sim_time_us, low, high, q, n, n_lz4 = _HEAD.unpack_from(data, 8)
    wire.finite([low, high, q])
    known = part < wire.PART_MAX and 0 < number < len(FIELD_NAMES) and sim_time_us < 1 << 53
    need(known and low <= high and 0 < q <= _Q_MAX, "RANGE", "part, kind, time, range or step of an interior are off")
    need(0 < n == n_node, "COUNT", f"an interior has {n} nodes, its asset has {n_node}")
    raw = np.frombuffer(lz4.expand(wire.need_block(data, _HEAD_BYTES, n_lz4), _NODE_BYTES * n), dtype=np.uint8)
    planes = raw[: 6 * n].reshape(3, 2, n).astype(np.uint16)
    folded = planes[:, 0] | planes[:, 1] << np.uint16(8)
    differences = folded >> np.uint16(1) ^ (np.uint16(0) - (folded & np.uint16(1)))
    steps = np.cumsum(differences, axis=1, dtype=np.uint16).view(np.int16)
    move = (steps.T * np.float64(q)).astype(np.float32)
    return Interior(part, FIELD_NAMES[number], epoch, sim_time_us, low, high, raw[6 * n :].copy(), q, move)


def tetrahedra_of(triangles: U32) -> U32:
    """Tetrahedra [m][4] from the triangles of an interior's asset, which are faces a b c and c b d of each; WireError
    when they are not."""
    need(len(triangles) % 2 == 0, "COUNT", f"an interior's asset has {len(triangles)} faces")
    first, second = triangles[::2], triangles[1::2]
    paired = (first[:, 1] == second[:, 1]).all() and (first[:, 2] == second[:, 0]).all()
    need(paired, "RANGE", "the faces of an interior's asset are no pairs")
    return np.concatenate([first, second[:, 2:]], axis=1)
