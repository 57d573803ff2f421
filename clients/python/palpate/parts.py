"""The parts of a session: their newest messages, and their assets, which threads of their own load: nobody waits for
those of a server that sends no more. Every method is called under the lock of the session but for the threads' own."""

import dataclasses
import http.client
import threading
from collections.abc import Callable
from dataclasses import dataclass

from . import wire
from .asset import Asset, decode_asset
from .control import Message, text_of, whole
from .errors import PalpateError, need
from .frame import FrameDecoder, epoch_of
from .interior import tetrahedra_of
from .planes import U32
from .topology_delta import decode_topology_delta
from .web import get

MESSAGE_MAX = 96 << 20  # bytes, as protocol/README.md, "Limits"
_ASSET_MAX = 257 << 20  # bytes
_ASSET_S = 60.0  # in which the server must go on sending an asset
_NOTICE_S = 2.0  # in which the websocket ends, or tells of other assets, when those of a part are gone


@dataclass(frozen=True)
class Loaded:
    """An asset and the decoder of its frames; the path names the content, so it may be used again."""

    path: str
    asset: Asset
    decoder: FrameDecoder


@dataclass(eq=False)
class Part:
    """One part and its newest messages. Those of frame, field and interior are decoded when they are asked for."""

    info: Message
    epoch: int
    path: str
    loaded: Loaded | None = None
    table: U32 | None = None
    inside: Asset | None = None
    asked_inside: bool = False
    frame: bytes | None = None
    field: bytes | None = None
    interior: bytes | None = None
    early_deltas: list[bytes] = dataclasses.field(default_factory=list)  # came before the asset


class Parts:
    """The present parts, `all`, and by their index the subscriptions, `subscribed`, which outlive a connection.

    changed: the session's lock, notified when an asset has come. connected: is there a connection? fail: takes why the
    session cannot go on.
    """

    def __init__(
        self,
        url: str,
        changed: threading.Condition,
        connected: Callable[[], bool],
        fail: Callable[[PalpateError], None],
    ) -> None:
        self.all: list[Part] = []
        self.subscribed: dict[int, Message] = {}
        self._url, self._changed, self._connected, self._fail = url, changed, connected, fail

    def at(self, index: int) -> Part:
        if not 0 <= index < len(self.all):
            raise PalpateError(f"there is no part {index}, the session has {len(self.all)}")
        return self.all[index]

    def subscribe(self, index: int, message: Message) -> None:
        part = self.at(index)
        if message.get("interior") and "interior" not in part.info:
            raise PalpateError(f"part {index} has no interior")
        self.subscribed[index] = message
        self._load_inside(part, message)

    def forget(self) -> None:
        """The messages of a connection that has ended."""
        for part in self.all:
            part.frame = part.field = part.interior = None

    def replace(self, infos: list[Message], anew: bool) -> None:
        """New parts, and those of a new epoch, load their assets; the others stay, but on a connection made anew, where
        changes of triangles begin at the asset again."""
        before, self.all = self.all, []
        known = {part.path: part.loaded for part in before if part.loaded}
        for index, info in enumerate(infos):
            epoch, path = whole(info, "epoch"), text_of(info, "asset")
            part = before[index] if index < len(before) else None
            if anew or part is None or (part.epoch, part.path) != (epoch, path):
                part = Part(info, epoch, path, known.get(path))
                if part.loaded:
                    part.table = part.loaded.asset.triangles.copy()
                else:
                    self._load_soon(part, path, self._take_asset)
            part.info = info
            self.all.append(part)
            self._load_inside(part, self.subscribed.get(index, {}))

    def take(self, kind: int, data: bytes) -> None:
        """A message of a part: FRAME, FIELD, INTERIOR or TOPOLOGY_DELTA."""
        index, _ = epoch_of(data)
        if index < len(self.all):
            self._take(self.all[index], kind, data)

    def _take(self, part: Part, kind: int, data: bytes) -> None:
        if epoch_of(data)[1] != part.epoch:
            return  # of an older epoch: control overtakes frames, so `topology` comes before the frames of its epoch
        if kind == wire.FRAME:
            part.frame = data
        elif kind == wire.FIELD:
            part.field = data
        elif kind == wire.INTERIOR:
            part.interior = data
        elif part.loaded is None or part.table is None:
            n_byte = len(data) + sum(map(len, part.early_deltas))
            need(n_byte <= MESSAGE_MAX, "COUNT", "too many changes of triangles have come before their asset")
            part.early_deltas.append(data)
        else:
            delta = decode_topology_delta(data, len(part.table), len(part.loaded.asset.rest_m))
            part.table[delta.slots] = delta.triangles

    # assets

    def _load_inside(self, part: Part, subscribed: Message) -> None:
        path = part.info.get("interior")
        if subscribed.get("interior") and not part.asked_inside and isinstance(path, str):
            part.asked_inside = True
            self._load_soon(part, path, self._take_inside)

    def _load_soon(self, part: Part, path: str, take: Callable[[Part, str, Asset], None]) -> None:
        threading.Thread(target=self._load, args=(part, path, take), name="palpate asset", daemon=True).start()

    def _load(self, part: Part, path: str, take: Callable[[Part, str, Asset], None]) -> None:
        """Fetches and decodes an asset; its failure ends the session, unless the connection is lost or the part
        replaced, when another one is loaded."""
        try:
            take(part, path, decode_asset(get(self._url, path, _ASSET_MAX, _ASSET_S)))
        except (OSError, ValueError, http.client.HTTPException, PalpateError) as error:
            other = isinstance(error, (ValueError, PalpateError))  # than that it is not, or no more, to be had
            with self._changed:

                def moot() -> bool:
                    return part not in self.all or not self._connected()

                if not other:
                    self._changed.wait_for(moot, _NOTICE_S)
                if not moot():
                    name = part.info.get("name", "")
                    self._fail(PalpateError(f"an asset of part {name} is not loaded: {error}"))

    def _take_asset(self, part: Part, path: str, asset: Asset) -> None:
        loaded = Loaded(path, asset, FrameDecoder(asset))
        with self._changed:
            part.loaded, part.table = loaded, asset.triangles.copy()
            for data in part.early_deltas:
                self._take(part, wire.TOPOLOGY_DELTA, data)
            part.early_deltas = []
            self._changed.notify_all()

    def _take_inside(self, part: Part, _: str, asset: Asset) -> None:
        tetrahedra_of(asset.triangles)
        with self._changed:
            part.inside = asset
            self._changed.notify_all()
