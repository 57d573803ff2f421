"""Arrays as byte planes and folded differences (protocol/README.md, "Assets")."""

import numpy as np
from numpy.typing import NDArray

U32 = NDArray[np.uint32]


def planes(raw: NDArray[np.uint8], at: int, n: int, n_plane: int = 4) -> U32:
    """n values of n_plane bytes each, first all low bytes, then the next ones."""
    out = np.zeros(n, dtype=np.uint32)
    for i in range(n_plane):
        out |= raw[at + i * n : at + (i + 1) * n].astype(np.uint32) << np.uint32(8 * i)
    return out


def unfold(values: U32) -> U32:
    """Signed differences modulo 2^32 from folded ones."""
    return values >> np.uint32(1) ^ (np.uint32(0) - (values & np.uint32(1)))


def running_sum(differences: U32) -> U32:
    """Sums along the first axis modulo 2^32."""
    sums: U32 = np.cumsum(differences, axis=0, dtype=np.uint32)
    return sums
