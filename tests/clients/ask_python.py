"""What clients/python answers: to golden packets and bad bytes, and beside a real server.

usage: ask_python.py packets FOLDER | touch URL | sculpt URL KEYS TICKET | adapt URL
Prints a line for each question; exit code 1 when an answer is wrong.
"""

import asyncio
import json
import pathlib
import struct
import sys
import tempfile
import threading

import numpy as np
import palpate
import websockets.server
from palpate import lz4

WAIT_S = 100  # only ends what hangs


def f32(values):
    return np.array(values, dtype=np.float32)


def need(good, text):
    if not good:
        raise AssertionError(text)


def refused(call, kind=palpate.PalpateError):
    """The error of the call, whose text is one sentence; None without one. Any other error goes on."""
    try:
        call()
    except kind as error:
        need(str(error) and "\n" not in str(error), f"no sentence: {error!r}")
        return error
    return None


class Packets:
    """The golden packets."""

    def __init__(self, folder):
        self.folder = pathlib.Path(folder)
        self.wanted = json.loads(self.load("expected.json"))
        self.asset = palpate.decode_asset(self.load("asset.bin"))
        self.decoder = palpate.FrameDecoder(self.asset)
        n, n_slot = len(self.asset.rest_m), len(self.asset.triangles)
        self.frames = [f"frame_{frame['name']}.bin" for frame in self.wanted["frames"]]
        self.readers = {
            "tools.bin": palpate.read_tools,
            "haptic.bin": palpate.read_haptic,
            "field.bin": lambda data: palpate.decode_field(data, self.wanted["field"]["n"]),
            "topology_delta.bin": lambda data: palpate.decode_topology_delta(data, n_slot, n),
            "asset.bin": palpate.decode_asset,
            **{name: self.decoder.decode for name in self.frames},
        }

    def load(self, name):
        return (self.folder / name).read_bytes()

    def pose_and_ack_are_written_byte_for_byte(self):
        p, ack = self.wanted["pose"], self.wanted["ack"]
        pose = palpate.Pose(
            p["tool"], p["seq"], p["stampUs"], p["position"], p["flags"], p["quaternion"], p["velocity"], p["omega"],
            p["force"], p["torque"], p["gripper"], p["buttons"], p["modelSeq"], p["modelAgeUs"], p["modelStampUs"],
        )  # fmt: skip
        need(palpate.write_pose(pose) == self.load("pose.bin"), "pose")
        need(palpate.write_ack(ack["cycle"], ack["decodeUs"]) == self.load("ack.bin"), "ack")

    def tools_have_their_numbers(self):
        got, wanted = palpate.read_tools(self.load("tools.bin")), self.wanted["tools"]
        need((got.cycle, got.sim_time_us) == (wanted["cycle"], wanted["simTimeUs"]), "head")
        need(len(got.tools) == len(wanted["tools"]), "number of tools")
        for tool, w in zip(got.tools, wanted["tools"], strict=True):
            whole = (tool.holder, tool.flags, tool.colour, tool.echo_seq, tool.hold_us, tool.echo_stamp_us)
            names = ("holder", "flags", "colour", "echoSeq", "holdUs", "echoStampUs")
            need(whole == tuple(w[k] for k in names), "whole numbers")
            got_floats = f32([tool.radius_m, *tool.position_m, *tool.quaternion, *tool.force_N])
            need((got_floats == f32([w["radius"], *w["position"], *w["quaternion"], *w["force"]])).all(), "floats")
            need(tool.held == bool(w["flags"] & 1) and tool.away == bool(w["flags"] & 16), "flags")

    def contact_model_has_its_numbers(self):
        got, w = palpate.read_haptic(self.load("haptic.bin")), self.wanted["haptic"]
        whole = (got.tool, got.seq, got.flags, got.stamp_us, got.echo_stamp_us, got.echo_seq, got.hold_us, got.frame_us)
        names = ("tool", "seq", "flags", "stampUs", "echoStampUs", "echoSeq", "holdUs", "frameUs")
        need(whole == tuple(w[k] for k in names), "whole numbers")
        need(got.origin_m.tolist() == w["origin"], "origin")
        g, wg = got.grasp, w["grasp"]
        have = f32([*got.force_ref_N, *got.torque_ref_N_m, *g.x0_m, *g.f0_N, *g.k_N_m, g.b_N_s_m, *g.arm_m])
        want = f32([*w["fRef"], *w["torqueRef"], *wg["x0"], *wg["f0"], *wg["k"], wg["b"], *wg["arm"]])
        need((have == want).all(), "reference and grasp")
        for p, wp in zip(got.contact_patches, w["contact_patches"], strict=True):
            have = [p.id, p.group, *p.p_m, *p.n, *p.v_m_s, p.k1_N_m, p.k2_N_m2, p.b_N_s_m, p.kt_N_m]
            have += [p.mu_s, p.mu_d, p.radius_m]
            names = ("k1", "k2", "b", "kt", "muS", "muD", "radius")
            want = [wp["id"], wp["group"], *wp["p"], *wp["n"], *wp["v"], *(wp[k] for k in names)]
            need((f32(have) == f32(want)).all(), "patch")

    def field_has_its_numbers(self):
        w = self.wanted["field"]
        got = self.readers["field.bin"](self.load("field.bin"))
        need((got.part, got.epoch, got.sim_time_us) == (w["part"], w["epoch"], w["simTimeUs"]), "head")
        need((got.name, got.low, got.high) == ("von_mises", w["low"], w["high"]), "range")
        need(got.level.tolist() == w["level"], "level")
        need(got.values[got.level == 255].tolist() == [w["high"]], "the largest value")

    def asset_has_its_numbers(self):
        w, a = self.wanted["asset"], self.asset
        need((a.rest_m.ravel() == f32(w["rest"])).all(), "rest")
        have = {"triangles": a.triangles, "vertexOf": a.vertex_of, "neighbour": a.neighbour, "weight": a.weight}
        for name, array in have.items():
            need(array.ravel().tolist() == w[name], name)
        need(len(a.levels) == w["levels"] and a.look is None and a.uv is None, "levels and looks")

    def topology_delta_gives_its_table(self):
        w = self.wanted["topology_delta"]
        got = self.readers["topology_delta.bin"](self.load("topology_delta.bin"))
        need((got.part, got.epoch, got.revision) == (w["part"], w["epoch"], w["revision"]), "head")
        need(got.slots.tolist() == w["slots"] and got.triangles.ravel().tolist() == w["corners"], "slots")
        table = self.asset.triangles.copy()
        table[got.slots] = got.triangles
        need(table.ravel().tolist() == w["triangles"], "table")

    def frames_in_any_order_have_the_same_bits(self):
        for w in [*self.wanted["frames"], *reversed(self.wanted["frames"])]:
            got = self.decoder.decode(self.load(f"frame_{w['name']}.bin"))
            whole = (got.part, got.epoch, got.seq, got.cycle, got.sim_time_us)
            need(whole == tuple(w[k] for k in ("part", "epoch", "seq", "cycle", "simTimeUs")), w["name"])
            need(np.float32(got.q_m) == np.float32(w["q"]), w["name"])
            need((got.positions_m.ravel() == f32(w["positions"])).all(), w["name"])

    def every_cut_and_every_further_byte_is_refused(self):
        for name, read in self.readers.items():
            data = self.load(name)
            for n in range(len(data)):
                need(refused(lambda: read(data[:n]), palpate.WireError), f"{name} cut to {n}")
            need(refused(lambda: read(data + b"\0"), palpate.WireError), f"{name} with a byte too many")

    def changed_bytes_are_refused_or_read(self):
        n_refused = 0
        for name, read in self.readers.items():
            data = self.load(name)
            for at in range(len(data)):
                values = (0, 255, data[at] ^ 16)
                for value in values if len(data) < 200 else values[at % 3 :][:1]:
                    bad = data[:at] + bytes([value]) + data[at + 1 :]
                    if name == "asset.bin" and at >= 40:  # with its checksum, or all else would not be reached
                        bad = bad[:28] + struct.pack("<I", fnv1a(bad[40:])) + bad[32:]
                    n_refused += refused(lambda: read(bad), palpate.WireError) is not None
        need(n_refused > 1000, f"{n_refused} refusals")

    def changed_codes_are_refused_or_read(self):
        n_refused = 0
        for name in self.frames:
            data = self.load(name)
            at = 92 if data[5] else 44
            raw = expanded(data[at:])
            for i in range(len(raw)):
                for value in {0, 85, 255, raw[i] ^ 16}:
                    block = literals(raw[:i] + bytes([value]) + raw[i + 1 :])
                    bad = data[:40] + struct.pack("<I", len(block)) + data[44:at] + block
                    n_refused += refused(lambda: self.decoder.decode(bad), palpate.WireError) is not None
        need(n_refused > 100, f"{n_refused} refusals")

    def frames_of_every_mode_are_those_of_the_definition(self):
        random = np.random.default_rng(7)
        n_group = -(-len(self.asset.rest_m) // 16)
        seen = set()
        for _ in range(200):
            modes = random.integers(0, 16, n_group).tolist()
            size = self.asset.rest_m.shape
            residuals = (random.geometric(0.2, size) * random.integers(-3, 4, size)).tolist()
            raw, kinds = coded(modes, residuals, random)
            seen |= kinds
            got = self.decoder.decode(frame_of(len(residuals), raw)).positions_m
            need((got == self.slow_positions(residuals, 1e-4)).all(), f"modes {modes}")
        wanted = {(mode, escape) for mode in range(15) for escape in (False, True)}
        need(wanted <= seen, f"modes and escapes {wanted - seen} were not tried")

    def slow_positions(self, residuals, q):
        """Positions as protocol/README.md, "FRAME" defines them, vertex by vertex in whole numbers."""
        x = []
        out = np.empty((len(residuals), 3), dtype=np.float32)
        neighbour, weight = self.asset.neighbour.tolist(), self.asset.weight.tolist()
        for i, (vertex, residual) in enumerate(zip(self.asset.vertex_of.tolist(), residuals, strict=True)):
            near = [(w, x[nb]) for w, nb in zip(weight[i], neighbour[i], strict=True) if w]
            x.append([(sum(w * at[c] for w, at in near) + 2048 >> 12) + 16 * residual[c] for c in range(3)])
            for c in range(3):
                out[vertex, c] = float(self.asset.rest_m[vertex, c]) + x[i][c] * (float(np.float32(q)) / 16)
        return out

    def blocks_expand_as_their_format_says(self):
        end = b"\x50BCDEF"
        for block, wanted in (
            (b"\x1fA\1\0\0" + end, b"A" * 20 + b"BCDEF"),  # a match of 15 + 0 + 4 bytes that overlaps itself
            (b"\x23AB\2\0" + end, b"AB" + b"ABABABA" + b"BCDEF"),
            (b"\x80ABCDEFGH\7\0" + end, b"ABCDEFGH" + b"BCDE" + b"BCDEF"),
            (b"\xa0ABCDEFGHIJ\x0f\0" + end, None),  # from before the beginning
            (b"\x23AB\0\0" + end, None),
            (b"\x23AB\2", None),
            (b"", None),
        ):
            n = len(wanted) if wanted else 19  # what the first refused one would expand to
            error = refused(lambda: need(lz4.expand(block, n) == wanted, f"{block!r}"), palpate.WireError)
            need((error is None) == (wanted is not None), f"{block!r}: {error!r}")
            need(refused(lambda: lz4.expand(block, n + 1), palpate.WireError), "a byte too few")
            need(refused(lambda: lz4.expand(block, n - 1), palpate.WireError), "a byte too many")

    def frames_of_impossible_codes_are_refused(self):
        n = len(self.asset.rest_m)
        modes = bytes([0xF0] + [0xFF] * ((-(-n // 16) + 1) // 2 - 1))  # group 0 alone has codes, with k = 0
        ones = 16 * 3 - 1
        zeros = modes + bits_to_bytes([0] * 13 + [1] * 24 + [1] * ones) + bytes(8)
        far = modes + bits_to_bytes([0] * 12 + [1] + [0] + [1] * 23 + [1] * ones) + bytes(8)
        late = modes + bits_to_bytes([1] * 3 * 16) + b"\1" + bytes(8)
        for raw, code in ((zeros, "COUNT"), (far, "RANGE"), (late, "COUNT"), (modes + bytes(8), "COUNT")):
            error = refused(lambda: self.decoder.decode(frame_of(n, raw)), palpate.WireError)
            need(error and error.code == code, f"{error!r} instead of {code}")

    def assets_that_cannot_be_trusted_are_refused(self):
        data = self.load("asset.bin")
        n, n_triangle = len(self.asset.rest_m), len(self.asset.triangles)
        raw = expanded(data[40:])
        for changes, code in (
            ({}, None),
            ({3 * n: 0x7F, 2 * n: 0xFF}, "NAN"),  # a rest position
            ({12 * n: raw[12 * n] ^ 2}, "ORDER"),  # the vertex of a wire index
            ({16 * n: 2}, "ORDER"),  # the first vertex has a neighbour
            ({16 * n + n // 2: 0}, "ORDER"),  # a vertex that is predicted from itself
            ({32 * n + n // 2: raw[32 * n + n // 2] ^ 1}, "ORDER"),  # a weight
            ({40 * n + 3 * n_triangle: 1}, "RANGE"),  # a corner
            ({40 * n + 12 * n_triangle: 1}, "ORDER"),  # the first level
        ):
            bad = bytearray(raw)
            for at, value in changes.items():
                bad[at] = value
            block = literals(bytes(bad))
            file = data[:24] + struct.pack("<II", len(block), fnv1a(block)) + data[32:40] + block
            error = refused(lambda: palpate.decode_asset(file), palpate.WireError)
            need((error.code if error else None) == code, f"{changes}: {error!r} instead of {code}")

    def control_messages_are_objects_with_a_type(self):
        lines = self.load("control.jsonl").decode().splitlines()
        need([palpate.read_control(line) for line in lines] == [json.loads(line) for line in lines], "numbers")
        for bad in ("", "[]", "1", "{}", '{"type":1}', '{"type":"hello","x":NaN}', "[" * 60000, '{"type":"hello"'):
            need(refused(lambda: palpate.read_control(bad), palpate.WireError), bad[:20])

    def bad_messages_of_a_server_end_a_session_with_their_sentence(self):
        hello = self.load("control.jsonl").decode().splitlines()[0]
        alone = json.dumps({**json.loads(hello), "parts": []})
        for messages, text in (
            ([alone, b"no message"], "a message does not begin with PAL1"),
            ([alone, "no message"], "a text message is not JSON"),
            ([alone, '{"type":"topology","parts":1}'], "parts of a message is no list of objects"),
            (['{"type":"hello"}'], "a hello does not say who this member is"),
            ([hello], "an asset of part liver"),
        ):
            with fake_server(messages) as url:
                error = refused(lambda: palpate.join(url, timeout=WAIT_S).tools(timeout=WAIT_S))
            need(error and text in str(error), f"{error!r} instead of {text}")

    def an_order_of_a_lost_connection_is_told_and_the_session_goes_on(self):
        hello = json.loads(self.load("control.jsonl").decode().splitlines()[0])
        with fake_server([json.dumps({**hello, "parts": []})]) as url:  # which goes away at an order
            for reconnect, joins in ((True, [2, 3]), (False, [1, 1])):
                with palpate.join(url, reconnect=reconnect, timeout=WAIT_S) as session:
                    for n_join in joins:
                        error = refused(lambda: session.order("pause", timeout=WAIT_S), palpate.Disconnected)
                        need(error and error.code == 1001, f"{error!r}")
                        if reconnect:
                            need("before pause was answered" in str(error), str(error))
                            session._wait(lambda: session._joined or None, WAIT_S, "not joined again")
                        need(session.joins == n_join, f"{session.joins} joins")

    def interiors_are_those_of_the_definition(self):
        random = np.random.default_rng(5)
        n, q = 50, np.float32(1e-4)
        steps = random.integers(-32768, 32768, (n, 3))
        level = random.integers(0, 256, n).astype(np.uint8)
        planes = b""
        for axis in steps.T.tolist():
            differences = [(b - a + 32768) % 65536 - 32768 for a, b in zip([0, *axis], axis, strict=False)]
            folded = [(d << 1 ^ d >> 15) & 0xFFFF for d in differences]
            planes += bytes(v & 255 for v in folded) + bytes(v >> 8 for v in folded)
        block = literals(planes + level.tobytes())
        head = b"PAL1" + struct.pack("<BBHIIQfffII", 6, 0, 3, 9, 2, 77, -1, 4, q, n, len(block))
        got = palpate.decode_interior(head + block, n)
        whole = (got.part, got.epoch, got.name, got.sim_time_us, got.low, got.high)
        need(whole == (3, 9, "von_mises", 77, -1, 4), f"{whole}")
        need((got.displacement_m == f32(steps * np.float64(q))).all() and (got.level == level).all(), "numbers")
        need(got.values[0] == -1 + 5 * level[0] / 255, "values")
        n_refused = 0
        for at in range(44):
            for value in (0, 255):
                bad = head[:at] + bytes([value]) + head[at + 1 :] + block
                n_refused += refused(lambda: palpate.decode_interior(bad, n), palpate.WireError) is not None
        need(n_refused > 30, f"{n_refused} refusals")
        for length in (*range(44), 50, len(head + block) - 1):
            need(refused(lambda: palpate.decode_interior((head + block)[:length], n), palpate.WireError), str(length))
        faces = np.array([[0, 1, 2], [2, 1, 3]], dtype=np.uint32)
        need(palpate.tetrahedra_of(faces).tolist() == [[0, 1, 2, 3]], "tetrahedra")
        for odd in (faces[:1], faces[:, ::-1]):
            need(refused(lambda: palpate.tetrahedra_of(odd), palpate.WireError), "no pairs")

    def tickets_are_those_of_the_server(self):
        key = bytes(range(32))  # this and the text: tests/protocol/test_ticket.c
        text = "AQcBAgMA669IqXJXleoqAAAAANJJa-_Nq4lnRSMBUEp1D5O_J5qG5TAA6x2ZvY3J_OddOK28FYjZT453Q5o"
        ticket = palpate.Ticket(
            "trainee", 2, 3, palpate.ticket_session("liver"), 42, 1800000000, nonce=0x0123456789ABCDEF
        )
        need(palpate.write_ticket(ticket, 7, key) == text, "text")
        need(palpate.read_ticket(text, {1: bytes(32), 7: key}) == ticket, "numbers")
        need(palpate.ticket_session("") == 0, "any session")
        for bad, keys in ((text, {1: key}), (text, {7: bytes(32)}), (text[:-1], {7: key}), (text + "A", {7: key}),
                          ("+" + text[1:], {7: key}), ("", {7: key}), ("\u00e9" * 83, {7: key})):  # fmt: skip
            need(refused(lambda: palpate.read_ticket(bad, keys)), bad)
        for wrong in ({"role": "surgeon"}, {"tool": 32}, {"uses": 65536}, {"expires_s": -1}):
            need(refused(lambda: palpate.write_ticket(palpate.Ticket(**wrong), 7, key)), str(wrong))
        need(refused(lambda: palpate.write_ticket(ticket, 7, b"short")), "a short key")

    def key_files_are_read_as_by_the_server(self):
        digits = bytes(range(32)).hex()
        with tempfile.NamedTemporaryFile("w") as file:
            for text, ids in (
                (f"# keys\n\n2 {digits}\n9 {digits.upper()}\n", [2, 9]),
                ("# nothing\n", None),
                (f"0 {digits}\n", None),
                (f"256 {digits}\n", None),
                (f"2 {digits[2:]}\n", None),
                (f"2 {digits}\n2 {digits}\n", None),
                ("2\n", None),
            ):
                file.seek(0)
                file.truncate()
                file.write(text)
                file.flush()
                error = refused(lambda: need(list(palpate.read_keys(file.name)) == ids, text))
                need((error is None) == (ids is not None), f"{text!r}: {error!r}")
            pathlib.Path(file.name).chmod(0o644)
            need("others" in str(refused(lambda: palpate.read_keys(file.name))), "who may read it")

    def what_a_caller_gives_wrongly_is_told(self):
        for position in ([0, 0], [0, 0, "x"], [0, 0, float("nan")], [0, 0, 1001]):
            need(refused(lambda: palpate.write_pose(palpate.Pose(0, 1, 0, position))), str(position))
        turned = palpate.Pose(0, 1, 0, [0, 0, 0], quaternion=[1, 1, 0, 0])
        need(refused(lambda: palpate.write_pose(turned)), "quaternion")
        need(refused(lambda: palpate.write_pose(palpate.Pose(-1, 1, 0, [0, 0, 0]))), "tool")
        need(refused(lambda: palpate.write_pose(palpate.Pose(0, 1, 0, [0, 0, 0], opening=1e300))), "opening")
        need("is no address" in str(refused(lambda: palpate.join("liver"))), "address")
        need("is no role" in str(refused(lambda: palpate.join("ws://127.0.0.1:1/ws", role="surgeon"))), "role")
        need(refused(lambda: palpate.join("ws://127.0.0.1:1/ws"), palpate.Disconnected), "nobody is there")


def fnv1a(data):
    value = 0x811C9DC5
    for byte in data:
        value = (value ^ byte) * 16777619 & 0xFFFFFFFF
    return value


def bits_to_bytes(bits):
    return np.packbits(np.array(bits, dtype=np.uint8), bitorder="little").tobytes()


def low_bits(value, n):
    return [value >> i & 1 for i in range(n)]


def coded(modes, residuals, random):
    """Body of a frame with these modes, and the pairs (mode, has an escape) in it.

    residuals [n][3] in wire order; those that a mode cannot have become 0.
    """
    bits, kinds = [], set()
    for group, mode in enumerate(modes):
        here = residuals[16 * group : 16 * group + 16]
        k = mode if mode < 7 else mode - 7
        if mode == 15:
            residuals[16 * group : 16 * group + 16] = [[0, 0, 0]] * len(here)
            continue
        if mode == 14:
            k = int(random.integers(0, 16))
            bits += low_bits(k, 4)
        elif mode >= 7:
            bits += [int(any(r)) for r in here]
        for value in (2 * v if v >= 0 else -2 * v - 1 for r in here if mode < 7 or mode == 14 or any(r) for v in r):
            escape = value >> k >= 12 or random.random() < 0.01
            kinds.add((mode, bool(escape)))
            bits += [0] * 12 + [1] + low_bits(value, 24) if escape else [0] * (value >> k) + [1] + low_bits(value, k)
    nibbles = [*modes, 0] if len(modes) % 2 else modes
    pairs = bytes(a | b << 4 for a, b in zip(nibbles[::2], nibbles[1::2], strict=True))
    return pairs + bits_to_bytes(bits) + bytes(8), kinds


def frame_of(n, raw):
    """A FRAME of part 2 with n vertices, steps of 0.1 mm and this body."""
    block = literals(raw)
    return b"PAL1" + struct.pack("<BBHIIQIfIII", 1, 0, 2, 5, 1, 0, 1, 1e-4, n, len(raw), len(block)) + block


def expanded(block):
    for n in range(1 << 16):
        try:
            return lz4.expand(block, n)
        except palpate.WireError:
            pass
    raise AssertionError("no length fits")


def literals(data):
    """An LZ4 block without a match."""
    n = len(data)
    if n < 15:
        return bytes([n << 4]) + data
    more, rest = divmod(n - 15, 255)
    return b"\xf0" + b"\xff" * more + bytes([rest]) + data


class fake_server:
    """A server in a thread of its own that sends these messages to whoever joins."""

    def __init__(self, messages):
        self.messages = messages
        self.loop = asyncio.new_event_loop()
        self.ready = threading.Event()
        self.thread = threading.Thread(target=lambda: self.loop.run_until_complete(self.run()))

    async def run(self):
        async def answer(socket):
            await socket.recv()
            for message in self.messages:
                await socket.send(message)
            async for heard in socket:
                if '"command"' in heard:
                    await socket.close(1001, "away")

        self.end = asyncio.Event()
        def no_file(path, headers):
            return None if path == "/ws" else (404, [], b"")

        names = ["palpate.v2"]
        serve = websockets.server.serve(answer, "127.0.0.1", 0, subprotocols=names, process_request=no_file)
        async with serve as server:
            self.port = server.sockets[0].getsockname()[1]
            self.ready.set()
            await self.end.wait()

    def __enter__(self):
        self.thread.start()
        self.ready.wait()
        return f"ws://127.0.0.1:{self.port}/ws"

    def __exit__(self, *error):
        self.loop.call_soon_threadsafe(self.end.set)
        self.thread.join()


class Proxy:
    """Passes on the bytes of connections to a server, until they are cut."""

    def __init__(self, port):
        self.server_port = port
        self.loop = asyncio.new_event_loop()
        self.server = self.loop.run_until_complete(asyncio.start_server(self.serve, "127.0.0.1", 0))
        self.port = self.server.sockets[0].getsockname()[1]
        self.writers = set()
        threading.Thread(target=self.loop.run_forever, daemon=True).start()

    async def serve(self, reader, writer):
        there_reader, there_writer = await asyncio.open_connection("127.0.0.1", self.server_port)
        self.writers |= {writer, there_writer}
        await asyncio.gather(self.copy(reader, there_writer), self.copy(there_reader, writer))

    async def copy(self, reader, writer):
        try:
            while data := await reader.read(65536):
                writer.write(data)
                await writer.drain()
        except OSError:
            pass  # cut
        writer.close()

    def cut(self):
        def now():
            for writer in self.writers:
                writer.transport.abort()
            self.writers.clear()

        self.loop.call_soon_threadsafe(now)


def climb(session, top_m, up, from_m, to_m, grasp):
    """Moves the tool in steps of half a millimetre, each of which a step of the simulation has used."""
    for height in np.linspace(from_m, to_m, 1 + int(abs(to_m - from_m) / 5e-4)):
        session.force_N(after=session.move(top_m + height * up, grasp), timeout=WAIT_S)


def pull(session, height_m):
    """Grasps the top of part 0 and pulls it up by so much; the place of the tool."""
    up = np.array([0.0, 0.0, 1.0])
    rest = session.asset(timeout=WAIT_S).rest_m
    top = rest[np.argmax(rest @ up)]
    radius = session.hello["tools"][session.tool]["radius_m"]
    climb(session, top, up, radius + 0.005, 0.5 * radius, False)
    for _ in range(5000):  # until it holds the tissue
        pose = session.move(top + 0.5 * radius * up, grasp=True)
        if session.tools(after=pose, timeout=WAIT_S).tools[session.tool].grasps:
            break
    climb(session, top, up, 0.5 * radius, 0.5 * radius + height_m, True)
    return top + (0.5 * radius + height_m) * up


class Touch:
    """A ball of 40 mm, for everybody."""

    def __init__(self, url):
        self.url = url
        self.session = palpate.join(url, name="Ada", timeout=WAIT_S)

    def who_joins_is_told_what_is_there(self):
        s = self.session
        need(s.hello["title"] == "Ball" and len(s.hello["tools"]) == 3 and s.tool == 0, "hello")
        need(s.hello["you"]["role"] == "trainee" and s.hello["you"]["name"] == "Ada", "you")
        need(s.status(WAIT_S)["paused"] is False, "status")
        asset = s.asset(timeout=WAIT_S)
        need(asset.rest_m.shape == (s.parts[0]["n_vertex"], 3), "shape of the asset")
        need(len(s.triangles()) == s.parts[0]["n_triangle"], "triangles")
        # without gravity the ball stays as it is, within the error of the part
        off = np.abs(s.frame(timeout=WAIT_S).positions_m - asset.rest_m).max()
        need(off <= 1.001 * s.parts[0]["error_m"], f"{off} m from rest")

    def a_tool_that_pulls_feels_force_and_moves_tissue(self):
        s = self.session
        at, rest = pull(s, 0.01), s.asset().rest_m
        force = s.force_N(after=s.move(at, grasp=True), timeout=WAIT_S)
        need(-force[2] > 0, f"{force} N on a tool that pulls up")
        frame = s.frame(timeout=WAIT_S)
        for _ in range(5000):
            if (frame.positions_m - rest)[:, 2].max() > 0.005:
                break
            frame = s.frame(after=frame, timeout=WAIT_S)
        up = (frame.positions_m - rest)[:, 2].max()
        need(0.005 < up < 0.015, f"the top has moved by {up} m")

    def values_of_a_field_come(self):
        s = self.session
        s.subscribe_field(0, "displacement")
        field = s.field(timeout=WAIT_S)
        need(field.name == "displacement" and field.values.shape == (len(s.asset().rest_m),), "shape")
        need(0.005 < field.high < 0.015, f"{field.high} m")

    def what_is_inside_comes_with_its_field(self):
        s = self.session
        s.subscribe_field(0, "displacement", interior=True)
        nodes = s.interior_asset(timeout=WAIT_S)
        tets = palpate.tetrahedra_of(nodes.triangles)
        a, b, c, d = (nodes.rest_m[tets[:, i]].astype(float) for i in range(4))
        volume = np.abs(np.einsum("ij,ij->i", np.cross(b - a, c - a), d - a)).sum() / 6
        # cells of 80 mm / 6 that touch the ball of 40 mm
        least, most = (4 / 3 * np.pi * r**3 for r in (0.039, 0.04 + 3**0.5 * 0.08 / 6))
        need(least < volume < most, f"{volume} m3, not from {least} to {most}")
        inside = None
        for _ in range(500):  # the pulled ball comes to rest: values are up to a frame older than displacements
            inside = s.interior(after=inside, timeout=WAIT_S)
            length = np.linalg.norm(inside.displacement_m, axis=1)
            off = np.abs(length - inside.values).max()
            bound = (inside.high - inside.low) / 510 + np.sqrt(3) / 2 * inside.q_m
            if off <= 1.01 * bound:
                break
        need(inside.name == "displacement" and len(inside.level) == len(nodes.rest_m), "shape")
        need(0.005 < length.max() < 0.015, f"the top has moved by {length.max()} m")
        need(off <= 1.01 * bound, f"{off} m between displacements and their lengths, at most {bound}")
        s.subscribe_field(0, "none")

    def a_resting_tool_stays_where_it_was_put(self):
        s = self.session
        at = np.array([0.0, 0.0, 0.1])
        s.lift()
        pose = s.move(at)
        at += 0.01  # the caller's array is its own
        shown = s.tools(after=pose + 3, timeout=WAIT_S).tools[s.tool]  # of a repeated pose
        need((f32(shown.position_m) == f32([0.0, 0.0, 0.1])).all(), f"{shown.position_m}")

    def the_list_of_sessions_names_this_one(self):
        (found,) = palpate.sessions(self.url, timeout=WAIT_S)
        need((found["name"], found["title"], found["members"]) == ("ball", "Ball", 1), f"{found}")
        error = refused(lambda: palpate.open_session(self.url, "ball.json", timeout=WAIT_S))
        need(error and "--scenes" in str(error), f"{error!r}")
        need(refused(lambda: palpate.sessions("http://127.0.0.1:1", timeout=WAIT_S)), "nobody is there")

    def a_lost_connection_comes_back_with_its_tool(self):
        proxy = Proxy(int(self.url.split(":")[2].split("/")[0]))
        with palpate.join(f"http://127.0.0.1:{proxy.port}", tool=2, timeout=WAIT_S) as s:
            s.subscribe_field(0, "displacement")
            s.field(timeout=WAIT_S)
            s.force_N(after=s.move([0, 0, 0.1]), timeout=WAIT_S)
            proxy.cut()
            s._wait(lambda: s._n_join == 2 or None, WAIT_S, "not joined again")
            pose = s.move([0, 0, 0.1], timeout=WAIT_S)
            need(s.tool == 2 and s.joins == 2, f"tool {s.tool}")
            need((s.force_N(after=pose, timeout=WAIT_S) == 0).all(), "force in the air")
            need(s.frame(timeout=WAIT_S).positions_m.shape == s.asset().rest_m.shape, "frame")
            need(s.field(timeout=WAIT_S).name == "displacement", "field")

    def orders_are_answered_or_refused(self):
        s = self.session
        need(s.order("pause", timeout=WAIT_S) == palpate.Answer("pause", "", {}), "pause")
        need(s.order("resume", timeout=WAIT_S) == palpate.Answer("resume", "", {}), "resume")
        need(s.order("material", "ball", young_Pa=5000.0, timeout=WAIT_S).verb == "material", "material")
        for code, verb, target, numbers in (
            ("verb", "fly", "", {}),
            ("target", "material", "kidney", {"young_Pa": 5000}),
            ("args", "material", "ball", {"young_kPa": 5}),
        ):
            error = refused(lambda: s.order(verb, target, timeout=WAIT_S, **numbers), palpate.OrderRefused)
            need(error and error.code == code, f"{verb}: {error!r}")
        need(refused(lambda: s.order("material", "ball", young_Pa=float("nan"))), "a number that is none")

    def a_closed_session_says_so(self):
        self.session.close()
        error = refused(lambda: self.session.order("pause"), palpate.Disconnected)
        need(error and error.code == 1000, f"{error!r}")


class Sculpt:
    """A block of control cells, for who has a ticket."""

    def __init__(self, url, keys, ticket):
        self.url = url
        self.keys = palpate.read_keys(keys)
        self.made = palpate.read_ticket(ticket, self.keys)
        key_id = list(self.keys)[-1]
        self.ticket = palpate.write_ticket(palpate.Ticket("instructor", uses=0), key_id, self.keys[key_id])

    def who_has_no_ticket_watches(self):
        with palpate.join(self.url, timeout=WAIT_S) as s:
            need(s.hello["you"]["role"] == "viewer" and s.tool is None, "role")
            need("holds no tool" in str(refused(lambda: s.move([0, 0, 0]))), "tool")
        error = refused(lambda: palpate.join(self.url, ticket="A" * 83, timeout=WAIT_S), palpate.Disconnected)
        need(error and error.code == 1008, f"{error!r}")

    def a_ticket_that_the_program_made_is_read(self):
        t = self.made
        need((t.role, t.tool, t.uses, t.user) == ("viewer", -2, 5, 9), f"{t}")
        need(t.session == palpate.ticket_session("block") and t.expires_s > 1700000000, f"{t}")

    def an_instructor_opens_and_ends_a_session(self):
        error = refused(lambda: palpate.open_session(self.url, "ball.json", timeout=WAIT_S))
        need(error and "only instructors" in str(error), f"{error!r}")
        name = palpate.open_session(self.url, "ball.json", ticket=self.ticket, timeout=WAIT_S)
        while (state := self.state(name)) == "opening":
            pass
        need(state == "running", f"{state}")
        with palpate.join(f"{self.url}?session={name}#{self.ticket}", timeout=WAIT_S) as s:
            need(s.hello["session"] == name, "the wanted session")
            s.asset(timeout=WAIT_S)  # nothing is fetched any more from a session that ends
            palpate.end_session(self.url, name, ticket=self.ticket, timeout=WAIT_S)
            error = refused(lambda: s._wait(lambda: None, WAIT_S, "not ended"), palpate.Disconnected)
            need(error and error.code == 4004, f"{error!r}")
        need(self.state(name) is None, "no longer in the list")

    def state(self, name):
        found = palpate.sessions(self.url, ticket=self.ticket, timeout=WAIT_S)
        return next((session["state"] for session in found if session["name"] == name), None)

    def an_edit_is_answered_and_gives_another_shape(self):
        with palpate.join(f"{self.url}#{self.ticket}", role="instructor", tool=None, timeout=WAIT_S) as s:
            rest = s.asset(timeout=WAIT_S).rest_m
            x, y, z = (float(v) for v in rest[np.argmax(rest @ np.array([0.1, 0.1, 1]))] - np.array([0.02, 0.02, 0]))
            young = s.order("probe", x_m=x, y_m=y, z_m=z, timeout=WAIT_S).numbers["young_Pa"]
            need(young > 0, "probe")
            before = s.parts[0]
            answer = s.order("extrude", "block", x_m=x, y_m=y, z_m=z, distance_m=0.02, scale=0.8, timeout=WAIT_S)
            need(answer.numbers["cells"] == 9 and answer.text, f"{answer}")
            for _ in range(100):  # `topology` comes with a later message
                if s.parts[0]["epoch"] != before["epoch"]:
                    break
                s.order("probe", x_m=x, y_m=y, z_m=z, timeout=WAIT_S)
            need(s.parts[0]["n_vertex"] > before["n_vertex"], "more vertices")
            frame = s.frame(timeout=WAIT_S)
            need(frame.positions_m.shape == s.asset(timeout=WAIT_S).rest_m.shape, "shape of the frame")
            need(len(frame.positions_m) > len(rest), "a frame of the other shape")
            error = refused(lambda: s.order("extrude", x_m=9, y_m=0, z_m=0, distance_m=0.1, timeout=WAIT_S))
            need(error and error.code == "refused", f"{error!r}")


class Adapt:
    """A surface that refines where it is touched."""

    def __init__(self, url):
        self.session = palpate.join(url, timeout=WAIT_S)

    def more_triangles_are_shown_where_it_is_pulled(self):
        s = self.session
        before = len(s.triangles(timeout=WAIT_S))
        at = pull(s, 0.02)
        for _ in range(5000):
            now = s.triangles()
            if len(now) > before:
                break
            s.force_N(after=s.move(at, grasp=True), timeout=WAIT_S)
        need(len(now) > before, f"{before} triangles before, {len(now)} now")
        edges = np.sort(np.concatenate([now[:, [0, 1]], now[:, [1, 2]], now[:, [2, 0]]]), axis=1)
        _, uses = np.unique(edges, axis=0, return_counts=True)
        need((uses == 2).all(), "the surface is closed: every edge has two triangles")


def main(part, *args):
    asked = {"packets": Packets, "touch": Touch, "sculpt": Sculpt, "adapt": Adapt}[part](*args)
    n_wrong = 0
    fallen = []  # threads that ended by an error
    threading.excepthook = lambda args: fallen.append(repr(args.exc_value))
    for name, question in vars(type(asked)).items():
        if name.startswith("__") or name in ("load", "slow_positions", "state"):
            continue
        sentence = name.replace("_", " ")
        try:
            question(asked)
            need(not fallen, f"threads have ended: {fallen}")
            print("ok  ", sentence, flush=True)
        except Exception as error:  # whatever it is, it is the answer
            n_wrong += 1
            print("FAIL", sentence, f"({type(error).__name__}: {error})", flush=True)
    return 1 if n_wrong else 0


sys.exit(main(*sys.argv[1:]))
