"""Every error of the package; the text of each is one sentence."""


class PalpateError(Exception):
    """Anything that went wrong between this client and the server."""


class WireError(PalpateError):
    """Bytes or text that are no message of the protocol.

    code: the name of the refusal, as in protocol/refusal.h (SHORT, LONG, MAGIC, KIND, FLAGS, RANGE, NAN, COUNT, LZ4,
    CHECKSUM, ORDER, JSON).
    """

    def __init__(self, code: str, text: str) -> None:
        super().__init__(text)
        self.code = code


class OrderRefused(PalpateError):
    """The server refused an order. code: as in protocol/README.md, "Commands"; the text is the server's sentence."""

    def __init__(self, code: str, text: str) -> None:
        super().__init__(text)
        self.code = code


class Disconnected(PalpateError):
    """The connection was refused or has ended.

    code: of the websocket's close (protocol/README.md, "Closing"), 0: none.
    """

    def __init__(self, code: int, text: str) -> None:
        super().__init__(text)
        self.code = code


class TookTooLong(PalpateError, TimeoutError):
    """What was waited for did not come in time. The session goes on."""


def need(good: object, code: str, text: str) -> None:
    """Raises WireError unless `good`."""
    if not good:
        raise WireError(code, text)
