"""The server's HTTP side: addresses, files, and the list of its sessions (protocol/README.md, "Sessions over HTTP")."""

import http.client
import json
import os
import urllib.error
import urllib.parse
import urllib.request
from collections.abc import Mapping

from .control import Message, objects
from .errors import PalpateError

_ANSWER_MAX = 1 << 20  # bytes of a list of sessions


class _NoRedirect(urllib.request.HTTPRedirectHandler):
    """Takes no other address: a ticket would go there."""

    def redirect_request(self, *_: object) -> None:
        return None


# straight to the server, as the websocket goes
_OPENER = urllib.request.build_opener(urllib.request.ProxyHandler({}), _NoRedirect())


def address_of(url: str, ticket: str | None) -> tuple[str, str]:
    """Address of the websocket and ticket, from the address that the server prints."""
    at = urllib.parse.urlsplit(url)
    scheme = {"http": "ws", "https": "wss"}.get(at.scheme, at.scheme)
    if scheme not in ("ws", "wss") or not at.netloc:
        raise PalpateError(f"{url} is no address such as ws://127.0.0.1:8090/ws")
    path = at.path if at.path not in ("", "/") else "/ws"
    given = ticket or at.fragment or os.environ.get("PALPATE_TICKET", "")
    return urllib.parse.urlunsplit((scheme, at.netloc, path, at.query, "")), given


def get(url: str, path: str, n_byte: int, timeout: float) -> bytes:
    """At most n_byte bytes of a file of the server of this websocket address, with its ?session= for proxies."""
    address = urllib.parse.urlsplit(urllib.parse.urljoin("http" + url[2:], path))
    if address.netloc != urllib.parse.urlsplit(url).netloc:
        raise PalpateError("an asset is said to be on another server")
    whole = address._replace(query=urllib.parse.urlsplit(url).query).geturl()
    with _OPENER.open(whole, timeout=timeout) as answer:
        data: bytes = answer.read(n_byte)
    return data


def _ask(url: str, ticket: str | None, order: Mapping[str, str] | None, timeout: float) -> Message:
    """What /sessions beside the websocket answers; to an order, when there is one."""
    address, given = address_of(url, ticket)
    head = {"Authorization": "Bearer " + given} if given else {}
    body = None if order is None else json.dumps(order).encode()
    if body:
        head["Content-Type"] = "application/json"
    request = urllib.request.Request(urllib.parse.urljoin("http" + address[2:], "/sessions"), body, head)
    try:
        with _OPENER.open(request, timeout=timeout) as answer:
            text = answer.read(_ANSWER_MAX)
    except urllib.error.HTTPError as refused:
        text = refused.read(_ANSWER_MAX)
        try:
            raise PalpateError(str(json.loads(text)["error"])) from None
        except (ValueError, KeyError, TypeError):
            raise PalpateError(f"the server answers with HTTP status {refused.code}") from None
    except (OSError, ValueError, http.client.HTTPException) as error:
        raise PalpateError(f"no answer from {address}: {str(error) or type(error).__name__}") from error
    try:
        message = json.loads(text)
    except (ValueError, RecursionError):
        message = None
    if not isinstance(message, dict):
        raise PalpateError("the server's answer about its sessions is no JSON object")
    return message


def sessions(url: str, *, ticket: str | None = None, timeout: float = 10.0) -> list[Message]:
    """What the server runs: name, title, state, members, tools, free_tools and more of each session.

    url, ticket: as for join(). With a ticket `people` of the sessions that it opens.
    """
    return objects(_ask(url, ticket, None, timeout), "sessions")


def open_session(url: str, scene: str, *, ticket: str | None = None, timeout: float = 10.0) -> str:
    """Opens a scene of the server's folder, as an instructor; the name of the session. It is in the list at once and
    can be joined when its state is no longer "opening". The server's sentence as PalpateError when it refuses."""
    return str(_ask(url, ticket, {"open": scene}, timeout).get("session"))


def end_session(url: str, name: str, *, ticket: str | None = None, timeout: float = 10.0) -> None:
    """Ends a session, as an instructor; its members are closed with 4004."""
    _ask(url, ticket, {"end": name}, timeout)
