"""FIELD messages (protocol/README.md, "FIELD"): one number for each vertex of a part."""

import struct
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from . import lz4, wire
from .errors import need

FIELD_NAMES = (
    "none",
    "displacement",
    "von_mises",
    "energy",
    "stiffness",
    "strain",
    "distortion",
    "young",
    "density",
    "damping",
)
"""Names by their number on the wire. Units: m, Pa, J/m3, J, 1, 1, Pa, kg/m3, 1/s."""

_HEAD = struct.Struct("<IIQ ff II")
_HEAD_BYTES = 40


@dataclass(frozen=True)
class Levels:
    """One number for each place of a part at one moment: level [n] uint8, 0 is low, 255 high, both in the field's unit."""

    part: int
    name: str
    epoch: int
    sim_time_us: int
    low: float
    high: float
    level: NDArray[np.uint8]

    @property
    def values(self) -> NDArray[np.float64]:
        """[n] in the field's unit, off by at most (high - low) / 510."""
        return self.low + (self.high - self.low) * self.level / 255.0


@dataclass(frozen=True)
class Field(Levels):
    """Values at the vertices of a part, in vertex order."""


def decode_field(data: bytes, n_vertex: int) -> Field:
    """A FIELD message of an asset with n_vertex vertices; WireError when it is none."""
    _, part = wire.read_head_of(data, wire.FIELD, 0, _HEAD_BYTES)
    epoch, number, sim_time_us, low, high, n, n_lz4 = _HEAD.unpack_from(data, 8)
    wire.finite([low, high])
    known = part < wire.PART_MAX and 0 < number < len(FIELD_NAMES)
    need(known and sim_time_us < 1 << 53 and low <= high, "RANGE", "part, kind, time or range of a field are off")
    need(n == n_vertex, "COUNT", f"a field has {n} vertices, its asset has {n_vertex}")
    level = np.frombuffer(lz4.expand(wire.need_block(data, _HEAD_BYTES, n_lz4), n), dtype=np.uint8)
    return Field(part, FIELD_NAMES[number], epoch, sim_time_us, low, high, level)
