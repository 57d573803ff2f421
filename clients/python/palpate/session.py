"""A joined session. A thread of the package receives, acknowledges, repeats poses and joins again after a loss; every
method may be called from any thread and waits at most its timeout. Frames and fields are decoded by the method that
asks for them, so that a script that reads forces alone decodes none."""

import asyncio
import json
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from types import TracebackType
from typing import Any, TypeVar

import numpy as np
import websockets.client
import websockets.exceptions
from numpy.typing import ArrayLike, NDArray
from websockets.typing import Subprotocol

from . import wire
from .asset import Asset
from .control import Message, objects, read_control, text_of, whole
from .errors import Disconnected, OrderRefused, PalpateError, TookTooLong, WireError
from .field import Field, decode_field
from .frame import Frame, FrameDecoder
from .interior import Interior, decode_interior
from .parts import MESSAGE_MAX, Parts
from .planes import U32
from .web import address_of
from .wire import Haptic, Pose, Tool, Tools, given, read_haptic, read_tools, write_ack, write_pose

_REPEAT_S = 0.05  # period of the repeated pose of a resting tool: the server releases one that is silent for 0.25 s
_PAUSE_FIRST_S, _PAUSE_MAX_S = 0.25, 5.0  # before joining again; each is twice the one before
# closures after which a client joins again (protocol/README.md, "Closing"); 0, 1005, 1006: without a code
_MAY_RETURN = frozenset((0, 1000, 1001, 1005, 1006, 1011, 4002, 4003, 4006))
# orders that end with an `answer`; the others are done, or refused, before the `pong` of a ping behind them
_ANSWERED = frozenset(
    "seek branch study_point configure delete divide extrude merge bridge sharpen paint set_rest_shape cut uncut "
    "undo redo probe".split()
)
# errors that tell what has happened (protocol/README.md, "Errors")
_NOT_OF_AN_ORDER = frozenset(("tool_idle", "tool_handed_over", "undone", "quality"))

T = TypeVar("T")


@dataclass(frozen=True)
class Answer:
    """What an order has done. text: the server's sentence, may be empty; numbers: by their names, which have units."""

    verb: str
    text: str
    numbers: dict[str, float]


@dataclass(eq=False)
class _Order:
    verb: str
    answer: Answer | None = None
    error: PalpateError | None = None


def _number(data: bytes, at: int, n_byte: int) -> int:
    """A whole number of a message, before it is decoded."""
    return int.from_bytes(data[at : at + n_byte], "little")


def join(
    url: str,
    *,
    name: str = "Python",
    role: str = "trainee",
    tool: int | None = -1,
    ticket: str | None = None,
    reconnect: bool = True,
    timeout: float = 10.0,
) -> "Session":
    """Joins the session at `url` and returns it once the server has said hello.

    url: ws[s]:// or http[s]://host[:port][/path][?session=NAME][#TICKET], as the server prints it; default path /ws.
    role: viewer, trainee or instructor. tool: index of the wanted tool, -1 any free one, None none; a viewer gets none.
    ticket: else that of the url, else that of the environment variable PALPATE_TICKET. reconnect: join again after a
    lost connection, with the tool that was held, the last pose and the subscriptions, until close() or a refusal.
    timeout: s. Raises Disconnected with the server's reason, or TookTooLong.
    """
    if role not in ("viewer", "trainee", "instructor"):
        raise PalpateError(f"{role} is no role: viewer, trainee or instructor")
    address, offered = address_of(url, ticket)
    wanted: Message = {"type": "join", "name": name, "role": role, "topology_deltas": True}
    if tool is not None and role != "viewer":
        wanted["tool"] = tool
    session = Session(address, offered, wanted, reconnect)
    try:
        session._wait(lambda: session._joined or None, timeout, "the server has not said hello")
    except PalpateError:
        session.close()
        raise
    return session


class Session:
    """A joined session, made by join(). A context manager: leaving it closes the connection."""

    def __init__(self, url: str, ticket: str, wanted: Message, reconnect: bool) -> None:
        self._url, self._ticket, self._wanted, self._reconnect = url, ticket, wanted, reconnect
        self._changed = threading.Condition()
        self._error: PalpateError | None = None
        self._hello: Message | None = None  # of this connection or an earlier one
        self._joined = False  # hello has come on this connection
        self._n_join = 0
        self._lost = ""  # why there is no connection
        self._status: Message | None = None
        self._members: list[Message] = []
        self._id = 0
        self._own_tool: int | None = None
        self._parts = Parts(url, self._changed, lambda: self._joined, self._fail)
        self._tools: Tools | None = None
        self._haptic: Haptic | None = None
        self._pose_seq = 0
        self._pose: Pose | None = None
        self._pong = 0
        self._ping = 0
        self._order: _Order | None = None
        self._ordering = threading.Lock()
        self._socket: websockets.client.WebSocketClientProtocol | None = None
        self._loop = asyncio.new_event_loop()
        self._main = self._loop.create_task(self._live())
        self._tasks: set[asyncio.Task[None]] = set()  # beside it
        self._thread = threading.Thread(target=self._run, name="palpate", daemon=True)
        self._thread.start()

    def __enter__(self) -> "Session":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Ends the connection and its thread. Waiting methods of other threads raise Disconnected."""
        self._end_soon()
        if threading.current_thread() is not self._thread:
            self._thread.join()

    # what the session is

    @property
    def hello(self) -> Message:
        """The server's `hello`: title, parts, tools, box_min_m, box_max_m, up, you (protocol/README.md, "Control")."""
        assert self._hello is not None  # join returns behind it
        return self._hello

    @property
    def joins(self) -> int:
        """How often the session was joined: 1, and one more after each lost connection."""
        with self._changed:
            return self._n_join

    @property
    def members(self) -> list[Message]:
        """Who is here: id, role, name, tool, rights."""
        with self._changed:
            return list(self._members)

    @property
    def parts(self) -> list[Message]:
        """The present parts: name, epoch, n_vertex, n_triangle, fields and the rest of their description."""
        with self._changed:
            return [part.info for part in self._parts.all]

    @property
    def tool(self) -> int | None:
        """Index of the own tool; None without one."""
        with self._changed:
            return self._own_tool

    def status(self, timeout: float = 10.0) -> Message:
        """The newest `status`, which comes three times a second: sim_time_s, paused, slowdown, step_ms and more."""
        return self._wait(lambda: self._status, timeout, "no status has come")

    # shapes

    def asset(self, part: int = 0, timeout: float = 60.0) -> Asset:
        """Rest shape and triangles of a part; loaded in the background after join and after each new epoch."""
        return self._wait(lambda: self._parts.at(part).loaded, timeout, f"the asset of part {part} has not come").asset

    def triangles(self, part: int = 0, timeout: float = 60.0) -> U32:
        """The present triangles of a part, [t][3], a copy; without the empty slots of an adaptive part."""

        def shown() -> U32 | None:
            table = self._parts.at(part).table
            return None if table is None else table[table.any(axis=1)]

        return self._wait(shown, timeout, f"the asset of part {part} has not come")

    def frame(self, part: int = 0, after: Frame | None = None, timeout: float = 60.0) -> Frame:
        """The newest frame of a part; with `after` another than that one. A part at rest has no newer frame."""

        def newest() -> tuple[FrameDecoder, bytes] | None:
            found = self._parts.at(part)
            if found.loaded is None or found.frame is None:
                return None
            moment = (found.epoch, _number(found.frame, 12, 4), _number(found.frame, 16, 8))
            if after and moment == (after.epoch, after.seq, after.sim_time_us):
                return None
            return found.loaded.decoder, found.frame

        decoder, data = self._wait(newest, timeout, f"no newer frame of part {part} has come")
        return decoder.decode(data)

    def subscribe_field(self, part: int, field: str, interior: bool = False) -> None:
        """Asks for a field of a part, one of its `fields`; "none" ends it. interior: its values and displacements at
        the nodes inside too, if the part has an `interior`."""
        message: Message = {"type": "subscribe_field", "part": part, "field": field}
        if interior:
            message["interior"] = True
        with self._changed:
            self._parts.subscribe(part, message)
            self._send(message)

    def field(self, part: int = 0, after: Field | None = None, timeout: float = 60.0) -> Field:
        """The newest values of the subscribed field; with `after` those of another time. A part at rest has no newer
        ones."""

        def newest() -> tuple[bytes, int] | None:
            found = self._parts.at(part)
            old = after and (after.epoch, after.sim_time_us)
            if found.loaded is None or found.field is None or (found.epoch, _number(found.field, 16, 8)) == old:
                return None
            return found.field, len(found.loaded.asset.rest_m)

        data, n_vertex = self._wait(newest, timeout, f"no newer field of part {part} has come")
        return decode_field(data, n_vertex)

    def interior_asset(self, part: int = 0, timeout: float = 60.0) -> Asset:
        """Nodes at rest inside a part whose interior is subscribed, and in tetrahedra_of(asset.triangles) the
        tetrahedra between them."""
        return self._wait(lambda: self._parts.at(part).inside, timeout, f"the interior of part {part} has not come")

    def interior(self, part: int = 0, after: Interior | None = None, timeout: float = 60.0) -> Interior:
        """The newest displacements and values inside a part whose interior is subscribed; `after` as for field()."""

        def newest() -> tuple[bytes, int] | None:
            found = self._parts.at(part)
            old = after and (after.epoch, after.sim_time_us)
            if found.inside is None or found.interior is None or (found.epoch, _number(found.interior, 16, 8)) == old:
                return None
            return found.interior, len(found.inside.rest_m)

        data, n_node = self._wait(newest, timeout, f"no newer interior of part {part} has come")
        return decode_interior(data, n_node)

    # the own tool

    def take_tool(self, tool: int, timeout: float = 10.0) -> None:
        """Takes a tool that nobody holds; OrderRefused "tool_taken" when somebody does."""
        n_tool = len(objects(self.hello, "tools"))
        if not 0 <= tool < n_tool:
            raise PalpateError(f"there is no tool {tool}, the session has {n_tool}")
        self._answered(_Order("take_tool"), {"type": "take_tool", "tool": tool}, timeout)
        self._wait(lambda: self._own_tool == tool or None, timeout, f"tool {tool} was not given")

    def move(
        self,
        position_m: ArrayLike,
        grasp: bool = False,
        quaternion: ArrayLike = (1.0, 0.0, 0.0, 0.0),
        timeout: float = 10.0,
    ) -> int:
        """Moves the own tool and returns the number of the pose, for force_N and tools.

        position_m [3]: of the tip, scene frame. grasp: closed; it holds what it touches when it closes. quaternion
        [4]: w x y z, 1 0 0 0 unknown. The pose is repeated until the next one, or lift(). A tool faster than 5 m/s, or
        20 sizes of the body a second, is lifted by the server: move it in steps. timeout: s, for a lost connection to
        come back.
        """
        return self._put_pose(position_m, quaternion, wire.GRASP if grasp else 0, wire.POSE_ONLY, timeout)

    def lift(self, timeout: float = 10.0) -> int:
        """Lifts the own tool out of the scene until the next move()."""
        with self._changed:
            at = self._pose.position_m if self._pose else (0.0, 0.0, 0.0)
        return self._put_pose(at, (1.0, 0.0, 0.0, 0.0), 0, wire.POSE_ONLY | wire.AWAY, timeout)

    def tools(self, after: int = 0, timeout: float = 10.0) -> Tools:
        """The newest state of all tools; with `after`, the number of an own pose, one of a step that has used it or a
        later one."""

        def newest() -> Tools | None:
            own = self._own()
            used = after == 0 or (own is not None and own.holder == self._id and own.echo_seq >= after)
            return self._tools if used else None

        return self._wait(newest, timeout, "no step has used the pose")

    def force_N(self, after: int = 0, timeout: float = 10.0) -> NDArray[np.float64]:
        """Force of the tissue on the own tool [3], N, scene frame, mean over the step; `after` as for tools()."""
        found = self.tools(after, timeout)
        index = self.tool
        if index is None or index >= len(found.tools):
            raise PalpateError("this member holds no tool")
        return found.tools[index].force_N

    @property
    def contact_model(self) -> Haptic | None:
        """The newest contact model of the own tool; None before the first."""
        with self._changed:
            return self._haptic

    # orders

    def order(self, verb: str, target: str = "", timeout: float = 60.0, **numbers: float) -> Answer:
        """Gives an order and returns its answer; OrderRefused with the server's code and sentence.

        verb, target and numbers: protocol/README.md, "Commands", and `palpate serve --help-protocol`, with units in
        the names: order("material", "liver", young_Pa=8000). Edits, probe, cut, configure, seek and branch return when
        they are done; the others when they are accepted, with an empty answer. timeout: s. Disconnected when the
        connection is lost meanwhile: whether the order was carried out is then unknown.
        """
        message = {"type": "command", "verb": verb, "target": target, "args": numbers}
        return self._answered(_Order(verb), message, timeout)

    def _answered(self, order: _Order, message: Message, timeout: float) -> Answer:
        def ended() -> Answer | None:
            if order.error:
                raise order.error
            if order.answer is None and order.verb not in _ANSWERED and self._pong >= ping:
                return Answer(order.verb, "", {})
            return order.answer

        def begin() -> int | None:
            if not self._joined:
                return None
            self._order = order
            self._ping += 1
            self._send(message)
            self._send({"type": "ping", "stamp_ms": self._ping})
            return self._ping

        with self._ordering:
            ping = self._wait(begin, timeout, f"{order.verb} was not sent")
            try:
                return self._wait(ended, timeout, f"{order.verb} was not answered")
            finally:
                with self._changed:
                    self._order = None

    # under the lock

    def _own(self) -> Tool | None:
        index = self._own_tool
        if self._tools is None or index is None or index >= len(self._tools.tools):
            return None
        return self._tools.tools[index]

    def _wait(self, get: Callable[[], T | None], timeout: float, late: str) -> T:
        """What `get` returns once it is not None."""
        end = time.monotonic() + timeout
        with self._changed:
            while (found := get()) is None:
                if self._error:
                    raise self._error
                left = end - time.monotonic()
                if left <= 0:
                    why = "" if self._joined or not self._lost else f": {self._lost}"
                    raise TookTooLong(f"{late} within {timeout:g} s{why}")
                self._changed.wait(left)
            return found

    # to the server

    def _send(self, message: Message | bytes) -> None:
        """Hands one message to the thread; the error of an ended connection."""
        try:
            data = message if isinstance(message, bytes) else json.dumps(message, allow_nan=False)
        except (TypeError, ValueError) as error:
            raise PalpateError(f"a message has a number that is none: {error}") from error
        with self._changed:
            if self._error:
                raise self._error
        try:
            self._loop.call_soon_threadsafe(self._start, data)
        except RuntimeError as error:
            raise Disconnected(0, "the connection has ended") from error

    def _start(self, data: str | bytes) -> None:
        if self._socket:
            self._spawn(self._write(data))

    async def _write(self, data: str | bytes) -> None:
        try:
            if self._socket:
                await self._socket.send(data)
        except websockets.exceptions.ConnectionClosed:
            pass  # reported by the receiving side

    def _put_pose(
        self, position_m: ArrayLike, quaternion: ArrayLike, buttons: int, flags: int, timeout: float
    ) -> int:
        at, turn = given("position_m", position_m, 3), given("quaternion", quaternion, 4)  # copies: it is repeated

        def put() -> int | None:
            if not self._joined:
                return None
            if self._own_tool is None:
                raise PalpateError("this member holds no tool")
            pose = Pose(self._own_tool, 0, 0, at, flags, turn, buttons=buttons)
            data = self._stamped(pose)
            self._pose = pose
            self._send(data)
            return pose.seq

        return self._wait(put, timeout, "the pose was not sent")

    def _stamped(self, pose: Pose) -> bytes:
        pose.stamp_us = time.monotonic_ns() // 1000
        pose.seq = self._pose_seq + 1
        data = write_pose(pose)
        self._pose_seq = pose.seq
        return data

    # the thread

    def _spawn(self, work: Any) -> None:
        task: asyncio.Task[None] = self._loop.create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    def _end_soon(self) -> None:
        try:
            self._loop.call_soon_threadsafe(self._main.cancel)
        except RuntimeError:
            pass  # the loop has ended by itself

    def _run(self) -> None:
        error: PalpateError
        try:
            self._loop.run_until_complete(self._main)
            error = Disconnected(0, "the connection has ended")
        except asyncio.CancelledError:
            error = Disconnected(1000, "the session was closed")  # unless the asset's error is there already
        except PalpateError as found:
            error = found
        with self._changed:
            self._error = self._error or error
            self._joined = False
            self._changed.notify_all()
        self._loop.close()

    async def _live(self) -> None:
        pause_s = _PAUSE_FIRST_S
        self._spawn(self._repeat())
        try:
            while True:
                n_join = self._n_join
                lost = await self._connection()
                with self._changed:
                    self._forget(lost)
                    self._changed.notify_all()
                if not self._n_join or not self._reconnect or lost.code not in _MAY_RETURN:
                    raise lost
                if self._n_join > n_join:
                    pause_s = _PAUSE_FIRST_S
                await asyncio.sleep(pause_s)
                pause_s = min(2 * pause_s, _PAUSE_MAX_S)
        finally:
            others = asyncio.all_tasks() - {self._main}
            for task in others:
                task.cancel()
            await asyncio.gather(*others, return_exceptions=True)

    async def _connection(self) -> Disconnected:
        """One connection, from its beginning to its end; how it ended."""
        try:
            return await self._connect()
        except websockets.exceptions.ConnectionClosed as closed:
            end = closed.rcvd or closed.sent
            code, reason = (end.code, end.reason) if end else (1006, "")
            return Disconnected(code, reason or f"the connection has ended with code {code}")
        except websockets.exceptions.InvalidStatusCode as refused:
            return Disconnected(0, f"the server answers with HTTP status {refused.status_code}")
        except (OSError, ValueError, asyncio.TimeoutError, websockets.exceptions.WebSocketException) as found:
            return Disconnected(0, f"no connection to {self._url}: {str(found) or type(found).__name__}")

    async def _connect(self) -> Disconnected:
        names = [Subprotocol(wire.PROTOCOL)] + ([Subprotocol("ticket." + self._ticket)] if self._ticket else [])
        async with websockets.client.connect(
            self._url, subprotocols=names, compression=None, max_size=MESSAGE_MAX, open_timeout=10, close_timeout=2
        ) as socket:
            await socket.send(json.dumps(self._wanted))
            async for data in socket:
                with self._changed:
                    cycle = self._take(data)
                    if self._joined and self._socket is None:
                        self._socket = socket
                        for message in self._parts.subscribed.values():
                            self._start(json.dumps(message))
                    self._changed.notify_all()
                if cycle is not None:
                    await socket.send(write_ack(cycle, 0))  # frames are decoded when they are asked for
        code = socket.close_code or 0
        return Disconnected(code, socket.close_reason or f"the connection has ended with code {code}")

    async def _repeat(self) -> None:
        while True:
            await asyncio.sleep(_REPEAT_S)
            with self._changed:
                data = self._stamped(self._pose) if self._pose and self._pose.tool == self._own_tool else None
            if data:
                await self._write(data)

    def _forget(self, lost: Disconnected) -> None:
        """What a connection that has ended leaves; under the lock."""
        self._joined, self._socket, self._lost = False, None, str(lost)
        self._tools = self._haptic = self._status = None
        if self._own_tool is not None:
            self._wanted["tool"] = self._own_tool
            self._own_tool = None
        self._parts.forget()
        if self._order and not self._order.answer:
            text = f"the connection was lost before {self._order.verb} was answered: {lost}"
            self._order.error = Disconnected(lost.code, text)

    def _fail(self, error: PalpateError) -> None:
        """Ends the session; under the lock."""
        self._error = self._error or error
        self._changed.notify_all()
        self._end_soon()

    # messages, under the lock

    def _take(self, data: str | bytes) -> int | None:
        """One message of the server. Returns the cycle to acknowledge, if it closes one."""
        if isinstance(data, str):
            self._take_control(read_control(data))
            return None
        kind, _, _ = wire.read_head(data)
        if kind == wire.TOOLS:
            self._tools = read_tools(data)
            return self._tools.cycle
        if kind == wire.HAPTIC:
            self._haptic = read_haptic(data)
        elif kind in (wire.FRAME, wire.FIELD, wire.INTERIOR, wire.TOPOLOGY_DELTA):
            self._parts.take(kind, data)
        return None

    def _take_control(self, message: Message) -> None:
        kind = message["type"]
        if kind == "hello":
            you = message.get("you")
            if not isinstance(you, dict):
                raise WireError("JSON", "a hello does not say who this member is")
            self._id = whole(you, "id")
            self._own_tool = None if you.get("tool") is None else whole(you, "tool")
            self._parts.replace(objects(message, "parts"), True)
            self._hello = message
            self._joined = True
            self._n_join += 1
        elif kind == "topology":
            self._parts.replace(objects(message, "parts"), False)
        elif kind == "status":
            self._status = message
        elif kind == "members":
            self._members = objects(message, "members")
            own = next((m for m in self._members if m.get("id") == self._id), None)
            if own:
                self._own_tool = None if own.get("tool") is None else whole(own, "tool")
        elif kind == "pong":
            self._pong = whole(message, "stamp_ms")
        elif kind == "answer" and self._order and message.get("verb") == self._order.verb:
            numbers = message.get("args", {})
            good = isinstance(numbers, dict) and all(isinstance(v, (int, float)) for v in numbers.values())
            if not good:
                raise WireError("JSON", "the numbers of an answer are none")
            self._order.answer = Answer(self._order.verb, str(message.get("text", "")), numbers)
        elif kind == "error" and self._order and message.get("code") not in _NOT_OF_AN_ORDER:
            self._order.error = OrderRefused(text_of(message, "code"), text_of(message, "text"))
