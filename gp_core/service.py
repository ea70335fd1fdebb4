"""A service for programs in other languages: touches in, pose out, as JSON over HTTP on this machine only.

It listens at 127.0.0.1 and nowhere else. Every answer is JSON, errors too, and the HTTP status says what it
is: 200 only for a pose that may be used, so that a client which checks nothing else is never handed a
withheld one. docs/service.md describes it for whoever connects.
"""

from __future__ import annotations

import json
import threading
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

import numpy as np

from gp_core.atlas.atlas import Atlas
from gp_core.disk import parse_json
from gp_core.errors import GpError
from gp_core.io.file_names import named_side
from gp_core.io.pose_export import pose_text
from gp_core.io.pose_inputs_json import inputs_from
from gp_core.landmarks.features import Side
from gp_core.landmarks.sets import LandmarkSet, Specimen
from gp_core.pose.answer import MAY_BE_USED, pose_answer
from gp_core.pose.cochlea_pose import ROUND_WINDOWS, CochleaPose
from gp_core.pose.estimate import compare_with_other_ear, estimate_from, estimate_pose
from gp_core.pose.estimate_inputs import EarInputs, versions_now
from gp_core.pose.gate import named_for_other_side
from gp_core.pose.systematic_error import DEFAULT_SHARED_ERROR_MM

__all__ = ["API_VERSION", "DEFAULT_PORT", "MAX_BYTES", "PoseService", "answer_request"]

API_VERSION = 1
DEFAULT_PORT = 18950
MAX_BYTES = 5_000_000
"""Size of the largest request."""

_MOST_CONNECTIONS = 16
_TIMEOUT_S = 30.0
_MOST_POINTS = 10_000
_KEYS = (
    *("side", "touches", "frame", "times_s", "method", "probe_noise_mm", "round_window", "shared_error_mm"),
    *("atlas", "source", "accept_warnings", "other_ear", "midline", "both_ears"),
)
_OK, _BAD, _FORBIDDEN, _NOT_FOUND, _NO_METHOD, _WITHHELD, _NO_LENGTH, _TOO_LARGE, _FAULT, _BUSY = (
    *(200, 400, 403, 404, 405, 409, 411, 413, 500, 503),
)
_LOCAL = ("127.0.0.1", "localhost", "[::1]")


class _RefusedError(Exception):
    """A request that is answered with an HTTP status of its own."""

    def __init__(self, status: int, problem: str, remedy: str = "") -> None:
        super().__init__(problem)
        self.status, self.problem, self.remedy = status, problem, remedy


@dataclass(frozen=True)
class _Known:
    """What the service has of its own: an atlas, or labelled animals."""

    atlas: Atlas
    specimens: Sequence[Specimen] = ()


def answer_request(content: Any, atlas: Atlas, specimens: Sequence[Specimen] = ()) -> dict[str, Any]:
    """Answer one request, as ``gp-core estimate --json`` would with the same touches and settings.

    Parameters
    ----------
    content : object
        A parsed request: touches and settings, or the whole content of a pose file.
    atlas : Atlas
        Used unless the request brings its own.
    specimens : sequence of Specimen
        Labelled animals, for JRMPC.

    Returns
    -------
    dict
        See `gp_core.pose.answer.pose_answer`.

    Raises
    ------
    GpError
        The request is wrong, or no pose can be estimated from it.
    """
    if not isinstance(content, dict):
        raise GpError("a request must be a JSON object", remedy='Such as {"side": "L", "touches": {...}}.')
    pose = _again(content) if "gpPose" in content else _estimated(content, _Known(atlas, specimens))
    source = "" if pose.inputs is None else pose.inputs.source
    also = (
        [named_for_other_side(source, pose.side)] if source and named_side(source) is pose.side.other else []
    )
    return pose_answer(pose, also, accept_warnings=_flag(content, "accept_warnings"))


def _again(content: Mapping[str, Any]) -> CochleaPose:
    """Estimate again what a pose file holds."""
    if content.get("inputs") is None:
        raise GpError("the pose does not contain its inputs", remedy="Send the touches.")
    try:
        made = inputs_from(content["inputs"])
    except (KeyError, TypeError, ValueError, AttributeError, OverflowError):
        raise GpError("the inputs of the pose are damaged", remedy="Send the touches.") from None
    return estimate_from(made)


def _estimated(content: Mapping[str, Any], known: _Known) -> CochleaPose:
    unknown = sorted(set(content) - set(_KEYS))
    if unknown:
        raise GpError(f"a request has no {unknown[0][:40]!r}", remedy=f"It may have {', '.join(_KEYS)}.")
    for key in ("side", "touches"):
        if key not in content:
            raise GpError(f"the request lacks {key!r}", remedy="Side and touches are needed.")
    method = _word(content, "method", "robust")
    side = Side.parse(_word(content, "side", ""))
    pose = estimate_pose(
        _touches(content, "touches", side),
        side,
        _atlas(content.get("atlas"), known, method),
        method=method,
        specimens=(known.specimens or None) if method == "jrmpc" else None,
        probe_noise=_number(content, "probe_noise_mm", None),
        round_window=_word(content, "round_window", ROUND_WINDOWS[0]),
        shared_error=_number(content, "shared_error_mm", DEFAULT_SHARED_ERROR_MM),  # type: ignore[arg-type]
        times=_times(content),
    )
    assert pose.inputs is not None
    pose = replace(pose, inputs=replace(pose.inputs, source=_word(content, "source", "")))
    return _with_other_ear(content, pose)


def _with_other_ear(content: Mapping[str, Any], pose: CochleaPose) -> CochleaPose:
    """Return the pose compared with the other ear, where the request brings its touches."""
    midline, combined = _names(content, "midline"), _flag(content, "both_ears")
    if "other_ear" not in content:
        if midline or combined:
            raise GpError("midline and both_ears need the touches of the other ear", remedy="Give other_ear.")
        return pose
    assert pose.inputs is not None
    touches = _touches(content, "other_ear", pose.side.other)
    inputs = replace(pose.inputs, touches=touches, times=None, source="")
    return compare_with_other_ear(pose, EarInputs(inputs, midline, combined))


def _atlas(own: Any, known: _Known, method: str) -> Atlas | None:
    """Return the atlas of a request; JRMPC judges side and names by one fitted to its animals."""
    if own is None:
        return None if method == "jrmpc" else known.atlas
    return Atlas.published() if own == "published" else Atlas.from_dict(_mapping(own, "atlas"))


def _touches(content: Mapping[str, Any], key: str, side: Side) -> LandmarkSet:
    touches = _mapping(content[key], key)
    if not all(isinstance(rows, list) for rows in touches.values()):
        raise GpError("each touch must be [x, y, z], or a list of such, in mm")
    if sum(np.size(rows) for rows in touches.values() if _is_even(rows)) > 3 * _MOST_POINTS:
        raise GpError(f"there are more than {_MOST_POINTS} touches")
    return LandmarkSet.from_touches(touches, side, frame=_word(content, "frame", "tracker"))


def _is_even(rows: list[Any]) -> bool:
    try:
        return np.ndim(rows) > 0
    except ValueError:  # rows of different lengths: refused by name later
        return False


def _times(content: Mapping[str, Any]) -> dict[str, float] | None:
    if content.get("times_s") is None:
        return None
    times = _mapping(content["times_s"], "times_s")
    return {name: _number(times, name, 0.0) for name in times}  # type: ignore[misc]


def _mapping(value: Any, name: str) -> dict[str, Any]:
    if not isinstance(value, dict):
        raise GpError(f"{name} must be a JSON object")
    return value


def _word(content: Mapping[str, Any], key: str, default: str) -> str:
    value = content.get(key, default)
    if not isinstance(value, str):
        raise GpError(f"{key} must be a text, got {str(value)[:40]}")
    return value


def _names(content: Mapping[str, Any], key: str) -> tuple[str, ...]:
    value = content.get(key, [])
    if not isinstance(value, list) or not all(isinstance(name, str) for name in value):
        raise GpError(f"{key} must be a list of names, got {str(value)[:40]}")
    return tuple(value)


def _number(content: Mapping[str, Any], key: str, default: float | None) -> float | None:
    value = content.get(key, default)
    if value is None:
        return default
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise GpError(f"{key} must be a number, got {str(value)[:40]}")
    try:
        return float(value)
    except OverflowError:
        raise GpError(f"{key} is too large a number") from None


def _flag(content: Mapping[str, Any], key: str) -> bool:
    value = content.get(key, False)
    if not isinstance(value, bool):
        raise GpError(f"{key} must be true or false, got {str(value)[:40]}")
    return value


class PoseService:
    """The service, on its own threads.

    Parameters
    ----------
    port : int
        0 lets the system choose.
    atlas : Atlas, optional
        By default the published one.
    specimens : sequence of Specimen
        Labelled animals, for JRMPC.

    Raises
    ------
    GpError
        The port is taken, or is none.

    Examples
    --------
    >>> service = PoseService(port=0)
    >>> service.url.startswith("http://127.0.0.1:")
    True
    >>> service.close()
    """

    def __init__(
        self, port: int = DEFAULT_PORT, *, atlas: Atlas | None = None, specimens: Sequence[Specimen] = ()
    ) -> None:
        if isinstance(port, bool) or not isinstance(port, int) or not 0 <= port <= 65535:
            raise GpError(f"the port must be a whole number from 0 to 65535, got {port!r}")
        try:
            self._server = _Server(port, _Known(atlas or Atlas.published(), specimens))
        except OSError as error:
            raise GpError(
                f"cannot listen at 127.0.0.1:{port} ({error.strerror or error})",
                remedy="Another program may listen there: choose another port.",
            ) from None
        self._thread = threading.Thread(target=self._server.serve_forever, name="gp-service", daemon=True)
        self._thread.start()

    @property
    def port(self) -> int:
        """Where it listens."""
        port: int = self._server.server_address[1]
        return port

    @property
    def url(self) -> str:
        """Where requests go, without a path."""
        return f"http://127.0.0.1:{self.port}"

    def close(self) -> None:
        """Stop listening; requests that are being answered are dropped."""
        self._server.shutdown()
        self._server.server_close()
        self._thread.join()

    def wait(self) -> None:
        """Wait until the service is closed, or Ctrl-C."""
        while self._thread.is_alive():
            self._thread.join(0.5)


class _Server(ThreadingHTTPServer):
    daemon_threads = True
    block_on_close = False

    def __init__(self, port: int, known: _Known) -> None:
        self.known = known
        self.estimating = threading.Lock()
        self._places = threading.BoundedSemaphore(_MOST_CONNECTIONS)
        super().__init__(("127.0.0.1", port), _Handler)

    def process_request(self, request: Any, client_address: Any) -> None:
        """Answer on a thread of its own, or not at all where too many are busy."""
        if not self._places.acquire(blocking=False):
            request.sendall(
                b"HTTP/1.1 503 Service Unavailable\r\nConnection: close\r\nContent-Length: 0\r\n\r\n"
            )
            self.shutdown_request(request)
            return
        super().process_request(request, client_address)

    def process_request_thread(self, request: Any, client_address: Any) -> None:
        """Answer, and free the place."""
        try:
            super().process_request_thread(request, client_address)
        finally:
            self._places.release()

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Say nothing of clients that go away."""


class _Handler(BaseHTTPRequestHandler):
    server: _Server
    protocol_version = "HTTP/1.1"
    server_version, sys_version = "gp-core", ""
    timeout = _TIMEOUT_S

    def do_GET(self) -> None:
        """Say what this is."""
        self._answer(self._about)

    def do_POST(self) -> None:
        """Estimate a pose."""
        self._answer(self._pose)

    def send_error(self, code: int, message: str | None = None, explain: str | None = None) -> None:
        """Report what is no HTTP, or another method, as JSON too."""
        status = _NO_METHOD if code == 501 else code
        self._send(status, _error(message or "this is not a valid request"))

    def log_message(self, format: str, *args: Any) -> None:
        """Print nothing."""

    def _answer(self, make: Any) -> None:
        try:
            self._check_local()
            self._send(*make())
        except _RefusedError as refused:
            self._send(refused.status, _error(refused.problem, remedy=refused.remedy))
        except GpError as error:
            about = {"landmark": error.landmark, "specimen": error.specimen}
            told = {key: value for key, value in about.items() if value}
            self._send(_BAD, _error(error.problem, remedy=error.remedy or "", **told))
        except (ConnectionError, TimeoutError):
            self.close_connection = True
        except Exception:  # a fault of this program; the client is told, and the service goes on
            self._send(_FAULT, _error("internal error of the service", remedy="Report it with this request."))

    def _check_local(self) -> None:
        """Refuse web pages: a browser of this machine could be led here."""
        host = self.headers.get("Host", "127.0.0.1").rsplit(":", 1)[0]
        if host not in _LOCAL or self.headers.get("Origin") is not None:
            self.close_connection = True
            raise _RefusedError(_FORBIDDEN, "requests from web pages are rejected")

    def _about(self) -> tuple[int, str]:
        if self.path != "/":
            raise _RefusedError(_NOT_FOUND, "no such path or method", "GET / or POST /estimate.")
        known = self.server.known
        content = {
            "service": "gp-core",
            "api": API_VERSION,
            "version": versions_now()["gp-labeler"],
            "atlas": known.atlas.name,
            "methods": ["robust", "jrmpc"] if known.specimens else ["robust"],
            "max_bytes": MAX_BYTES,
        }
        return _OK, json.dumps(content, indent=1) + "\n"

    def _pose(self) -> tuple[int, str]:
        body = self._body()
        if self.path != "/estimate":
            raise _RefusedError(_NOT_FOUND, "no such path or method", "GET / or POST /estimate.")
        known = self.server.known
        content = _parsed(body)
        with self.server.estimating:  # one at a time: answers do not depend on who else asks
            answer = answer_request(content, known.atlas, known.specimens)
        return _OK if answer["status"] == MAY_BE_USED else _WITHHELD, pose_text(answer)

    def _body(self) -> bytes:
        length = self.headers.get("Content-Length", "")
        if not (length.isascii() and length.isdigit()):
            self.close_connection = True
            raise _RefusedError(_NO_LENGTH, "the request has no Content-Length")
        if len(length) > len(str(MAX_BYTES)) or int(length) > MAX_BYTES:
            self.close_connection = True
            raise _RefusedError(_TOO_LARGE, f"the request is larger than {MAX_BYTES} bytes")
        return self.rfile.read(int(length))

    def _send(self, status: int, text: str) -> None:
        data = text.encode()
        self.send_response(status)
        self.send_header("Content-Type", "application/json")
        self.send_header("Content-Length", str(len(data)))
        self.send_header("Cache-Control", "no-store")
        if self.close_connection:
            self.send_header("Connection", "close")
        self.end_headers()
        if self.command != "HEAD":
            self.wfile.write(data)


def _error(problem: str, **about: str) -> str:
    told = {"problem": problem, **{key: value for key, value in about.items() if value}}
    return json.dumps({"status": 2, "error": told}, indent=1) + "\n"


def _parsed(body: bytes) -> Any:
    """Parse a request; names that are given twice, and numbers that are none, are refused."""
    try:
        return parse_json(
            body.decode("utf-8-sig"),
            parse_constant=_no_number,
            remedy="Give all touches of a feature as one list of positions.",
        )
    except (ValueError, RecursionError):
        raise GpError("the request is not JSON", remedy="Send one JSON object in UTF-8.") from None


def _no_number(word: str) -> float:
    raise GpError(f"{word} is not a JSON number", remedy="Leave out what was not seen.")
