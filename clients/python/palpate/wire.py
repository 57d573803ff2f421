"""Binary messages except the bodies of FRAME, FIELD and TOPOLOGY_DELTA (protocol/README.md; protocol/wire.h)."""

import math
import struct
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .errors import PalpateError, need

PROTOCOL = "palpate.v2"
MAGIC = b"PAL1"
FRAME, TOOLS, HAPTIC, FIELD, TOPOLOGY_DELTA, INTERIOR, POSE, ACK = 1, 2, 3, 4, 5, 6, 16, 17
KINDS = frozenset((FRAME, TOOLS, HAPTIC, FIELD, TOPOLOGY_DELTA, INTERIOR, POSE, ACK))
TOOL_MAX = 32
PART_MAX = 16
VERTEX_MAX = 1 << 22
POSE_ONLY, AWAY = 128, 256  # flags of a pose
GRASP = 1  # button of a pose

_HEAD = struct.Struct("<4sBBH")
_TOOLS = struct.Struct("<IIQ")
_TOOL = struct.Struct("<HHI 11f IIQ")
_HAPTIC = struct.Struct("<IIQQ IIII 3d 6f I 16f")
_PATCH = struct.Struct("<HH 16f")
_POSE = struct.Struct("<4sBBH IIQ 3d 4d 13f III Q")
_ACK = struct.Struct("<4sBBH II")

Vector = NDArray[np.float64]


def read_head(data: bytes) -> tuple[int, int, int]:
    """Kind, flags and index of any binary message."""
    need(len(data) >= 8, "SHORT", "a message has no head")
    magic, kind, flags, index = _HEAD.unpack_from(data)
    need(magic == MAGIC, "MAGIC", "a message does not begin with PAL1")
    need(kind in KINDS, "KIND", f"message kind {kind} is unknown")
    return kind, flags, index


def read_head_of(data: bytes, kind: int, flags_max: int, size: int) -> tuple[int, int]:
    """Flags and index of a message of this kind that is at least `size` bytes long."""
    found, flags, index = read_head(data)
    need(found == kind, "KIND", f"a message is of kind {found} and not {kind}")
    need(flags <= flags_max, "FLAGS", f"message flags {flags} are unknown")
    need(len(data) >= size, "SHORT", f"a message has {len(data)} bytes of {size}")
    return flags, index


def need_block(data: bytes, at: int, n_lz4: int) -> bytes:
    """The LZ4 block that is the rest of the message behind `at`."""
    need(n_lz4 <= len(data) - at, "SHORT", "a compressed block is cut short")
    need(n_lz4 >= len(data) - at, "LONG", "there are bytes behind a compressed block")
    return data[at:]


def finite(values: Iterable[float]) -> None:
    """WireError NAN unless all are finite."""
    need(all(map(math.isfinite, values)), "NAN", "a number of a message is not finite")


def exactly(data: bytes, size: int) -> None:
    need(len(data) >= size, "SHORT", f"a message has {len(data)} bytes of {size}")
    need(len(data) <= size, "LONG", f"a message has {len(data)} bytes instead of {size}")


def exact(*counts: int) -> None:
    need(max(counts) < 1 << 53, "RANGE", "a whole number of a message is not below 2^53")


def _vector(values: Iterable[float]) -> Vector:
    return np.array(tuple(values), dtype=np.float64)


@dataclass(frozen=True)
class Tool:
    """One tool as the step shown has used it.

    holder: member id, 0 nobody; colour: 0xRRGGBB; position_m [3]; quaternion [4], 1 0 0 0 unknown; force_N [3] of the
    tissue on the tool; echo_seq: newest pose of the holder in use, 0 none; hold_us: from that pose's arrival to this
    message; echo_stamp_us: the stamp of that pose.
    """

    holder: int
    flags: int
    colour: int
    radius_m: float
    position_m: Vector
    quaternion: Vector
    force_N: Vector
    echo_seq: int
    hold_us: int
    echo_stamp_us: int

    @property
    def held(self) -> bool:
        """A member moves it."""
        return bool(self.flags & 1)

    @property
    def touches(self) -> bool:
        """It is in contact with tissue."""
        return bool(self.flags & 2)

    @property
    def grasps(self) -> bool:
        """It holds tissue."""
        return bool(self.flags & 4)

    @property
    def stale(self) -> bool:
        """No pose has come for 0.25 s."""
        return bool(self.flags & 8)

    @property
    def away(self) -> bool:
        """It is lifted out of the scene and not shown."""
        return bool(self.flags & 16)


@dataclass(frozen=True)
class Tools:
    """All tools at the end of a cycle. sim_time_us: simulated time."""

    cycle: int
    sim_time_us: int
    tools: tuple[Tool, ...]


def _read_tool(data: bytes, at: int) -> Tool:
    holder, flags, colour, *f, echo_seq, hold_us, echo_stamp_us = _TOOL.unpack_from(data, at)
    finite(f)
    exact(echo_stamp_us)
    need(flags < 32, "FLAGS", f"tool flags {flags} are unknown")
    need(f[0] >= 0 and colour <= 0xFFFFFF, "RANGE", "a tool has an impossible radius or colour")
    return Tool(
        holder, flags, colour, f[0], _vector(f[1:4]), _vector(f[4:8]), _vector(f[8:]), echo_seq, hold_us, echo_stamp_us
    )


def read_tools(data: bytes) -> Tools:
    """A TOOLS message, which closes a cycle."""
    _, n = read_head_of(data, TOOLS, 0, 24)
    need(n <= TOOL_MAX, "COUNT", f"a message has {n} tools")
    exactly(data, 24 + _TOOL.size * n)
    cycle, zero, sim_time_us = _TOOLS.unpack_from(data, 8)
    need(zero == 0, "RANGE", "a reserved number of a message is not 0")
    exact(sim_time_us)
    return Tools(cycle, sim_time_us, tuple(_read_tool(data, 24 + _TOOL.size * i) for i in range(n)))


@dataclass(frozen=True)
class ContactPatch:
    """One plane of a contact model. p_m [3] relative to the model's origin, n [3] unit normal, v_m_s [3]; the rest are
    stiffness, damping, friction and the radius within which it holds."""

    id: int
    group: int
    p_m: Vector
    n: Vector
    v_m_s: Vector
    k1_N_m: float
    k2_N_m2: float
    b_N_s_m: float
    kt_N_m: float
    mu_s: float
    mu_d: float
    radius_m: float


@dataclass(frozen=True)
class Grasp:
    """The spring of a grasp. x0_m [3] relative to the model's origin, f0_N [3], k_N_m [6] xx xy xz yy yz zz, arm_m [3]
    from the tool's centre to where the force acts."""

    x0_m: Vector
    f0_N: Vector
    k_N_m: Vector
    b_N_s_m: float
    arm_m: Vector


@dataclass(frozen=True)
class Haptic:
    """Contact model of one tool, to be rendered at 1 kHz or more (protocol/README.md, "HAPTIC"). origin_m [3],
    force_ref_N [3] and torque_ref_N_m [3] on the tool at the origin; grasp: None without one."""

    tool: int
    seq: int
    flags: int
    stamp_us: int
    echo_stamp_us: int
    echo_seq: int
    hold_us: int
    frame_us: int
    origin_m: Vector
    force_ref_N: Vector
    torque_ref_N_m: Vector
    grasp: Grasp | None
    contact_patches: tuple[ContactPatch, ...]


def _read_patch(data: bytes, at: int) -> ContactPatch:
    ident, group, *f = _PATCH.unpack_from(data, at)
    finite(f)
    k1, _, b, kt, mu_s, mu_d, radius = f[9:]
    normal = f[3] ** 2 + f[4] ** 2 + f[5] ** 2
    need(
        min(k1, b, kt, mu_s, mu_d, radius) >= 0 and abs(normal - 1) <= 1e-3, "RANGE", "a contact patch is impossible"
    )
    return ContactPatch(ident, group, _vector(f[:3]), _vector(f[3:6]), _vector(f[6:9]), *f[9:])


def read_haptic(data: bytes) -> Haptic:
    """A HAPTIC message, the contact model of one tool."""
    _, tool = read_head_of(data, HAPTIC, 0, 164)
    values = _HAPTIC.unpack_from(data, 8)
    seq, flags, stamp_us, echo_stamp_us, echo_seq, hold_us, frame_us, n = values[:8]
    origin, forces, has_grasp, g = values[8:11], values[11:17], values[17], values[18:]
    need(n <= 8, "COUNT", f"a contact model has {n} patches")
    exactly(data, 164 + _PATCH.size * n)
    finite(origin + forces + g)
    exact(stamp_us, echo_stamp_us)
    need(flags < 8, "FLAGS", f"flags {flags} of a contact model are unknown")
    possible = tool < TOOL_MAX and has_grasp <= 1 and g[12] >= 0
    need(possible, "RANGE", "the tool or grasp of a contact model is impossible")
    grasp = Grasp(_vector(g[:3]), _vector(g[3:6]), _vector(g[6:12]), g[12], _vector(g[13:]))
    return Haptic(
        tool,
        seq,
        flags,
        stamp_us,
        echo_stamp_us,
        echo_seq,
        hold_us,
        frame_us,
        _vector(origin),
        _vector(forces[:3]),
        _vector(forces[3:]),
        grasp if has_grasp else None,
        tuple(_read_patch(data, 164 + _PATCH.size * i) for i in range(n)),
    )


@dataclass
class Pose:
    """What a client sends of its tool (protocol/README.md, "POSE"). stamp_us: the client's monotonic clock; position_m
    [3]; quaternion [4] of length 1, 1 0 0 0 unknown; velocity_m_s, omega_rad_s, force_N, torque_N_m [3] each; opening
    of a gripper in rad or m; buttons: 1 grasp; model_seq: of the contact model in use, 0 none."""

    tool: int
    seq: int
    stamp_us: int
    position_m: ArrayLike
    flags: int = POSE_ONLY
    quaternion: ArrayLike = (1.0, 0.0, 0.0, 0.0)
    velocity_m_s: ArrayLike = (0.0, 0.0, 0.0)
    omega_rad_s: ArrayLike = (0.0, 0.0, 0.0)
    force_N: ArrayLike = (0.0, 0.0, 0.0)
    torque_N_m: ArrayLike = (0.0, 0.0, 0.0)
    opening: float = 0.0
    buttons: int = 0
    model_seq: int = 0
    model_age_us: int = 0
    model_stamp_us: int = 0


def given(name: str, value: ArrayLike, n: int) -> list[float]:
    """A copy of n finite numbers of the caller."""
    try:
        out = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise PalpateError(f"{name} of a pose is no array of {n} numbers") from error
    if out.shape != (n,) or not np.isfinite(out).all():
        raise PalpateError(f"{name} of a pose is no array of {n} finite numbers")
    return [float(number) for number in out]


def write_pose(pose: Pose) -> bytes:
    """The POSE message, 152 bytes; PalpateError when a number has no place in it."""
    floats: list[Any] = given("position_m", pose.position_m, 3) + given("quaternion", pose.quaternion, 4)
    if max(abs(x) for x in floats[:3]) > 1000 or abs(sum(q * q for q in floats[3:]) - 1) > 1e-3:
        raise PalpateError("a pose is farther than 1000 m away, or its quaternion is not of length 1")
    for name in ("velocity_m_s", "omega_rad_s", "force_N", "torque_N_m"):
        floats += given(name, getattr(pose, name), 3)
    head = (MAGIC, POSE, 0, pose.tool, pose.seq, pose.flags, pose.stamp_us)
    tail = (pose.opening, pose.buttons, pose.model_seq, pose.model_age_us, pose.model_stamp_us)
    try:
        return _POSE.pack(*head, *floats, *tail)
    except (struct.error, OverflowError) as error:
        raise PalpateError(f"a number of a pose is out of its range: {error}") from error


def write_ack(cycle: int, decode_us: int) -> bytes:
    """The ACK of a TOOLS message. decode_us: time spent on the cycle."""
    return _ACK.pack(MAGIC, ACK, 0, 0, cycle, min(max(decode_us, 0), 2**32 - 1))
