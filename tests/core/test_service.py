"""The service: the answers of ``gp-core estimate --json`` over HTTP, on this machine only."""

from __future__ import annotations

import http.client
import json
import shutil
import socket
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from gp_core import Atlas, GpError, estimate_pose, read_touches
from gp_core.cli.entry import main
from gp_core.service import MAX_BYTES, PoseService

EXAMPLE = Path("docs/example/touches.csv")
CLIENTS = Path("docs/example/clients")
ATLAS = Atlas.published()


@pytest.fixture(scope="module")
def service() -> Iterator[PoseService]:
    service = PoseService(port=0)
    yield service
    service.close()


def _touches() -> dict[str, Any]:
    return {code: point.tolist() for code, point in read_touches(EXAMPLE, "L").as_mapping().items()}


def _ask(
    service: PoseService, body: Any, *, method: str = "POST", path: str = "/estimate", **headers: str
) -> tuple[int, dict[str, Any]]:
    connection = http.client.HTTPConnection("127.0.0.1", service.port, timeout=30)
    data = body if isinstance(body, bytes) else json.dumps(body).encode()
    connection.request(method, path, data, headers)
    answer = connection.getresponse()
    content = json.loads(answer.read())
    connection.close()
    return answer.status, content


def test_the_answer_is_that_of_the_command(service: PoseService, tmp_path: Path) -> None:
    main(["estimate", str(EXAMPLE), "--side", "L", "--json", str(tmp_path / "pose.json")])
    told = json.loads((tmp_path / "pose.json").read_text())
    request = {"side": "L", "touches": _touches(), "source": "touches.csv"}
    status, answer = _ask(service, request)
    assert status == 200
    for content in (told, answer):
        del content["stamp"], content["stamp_unix_s"]
    assert answer == told
    status, again = _ask(service, told)  # a pose file is a request too
    assert (status, again["transform"]) == (200, told["transform"])


def test_settings_and_repeats_are_those_of_python(service: PoseService) -> None:
    touches = _touches()
    touches["MN"] = [touches["MN"], [x + 0.2 for x in touches["MN"]]]
    request = {
        "side": "L",
        "touches": {**touches, "S1": [1, 2, 3]},
        "shared_error_mm": 0.4,
        "probe_noise_mm": 0.2,
        "round_window": "expected",
        "times_s": {code: 5.0 * i for i, code in enumerate(touches)},
        "atlas": ATLAS.as_dict(),
    }
    pose = estimate_pose(
        touches,
        "L",
        probe_noise=0.2,
        shared_error=0.4,
        round_window="expected",
        times=request["times_s"],  # type: ignore[arg-type]
    )
    _, answer = _ask(service, request)
    assert {key: answer[key] for key in pose.as_dict()} == json.loads(json.dumps(pose.as_dict()))


def test_a_withheld_pose_is_no_success(service: PoseService) -> None:
    touches = {code: ATLAS[code].tolist() for code in ("CL", "LLI", "MN", "OS", "RWA", "RWP")}
    touches["CL"], touches["OS"] = touches["OS"], touches["CL"]
    status, answer = _ask(service, {"side": "L", "touches": touches})
    assert (status, answer["status"]) == (409, 3)
    assert answer["names_state"] == "wrong"
    assert [reason["code"] for reason in answer["reasons"]] == ["wrong names"]
    status, answer = _ask(service, {"side": "L", "touches": touches, "accept_warnings": True})
    assert (status, answer["status"]) == (200, 0)
    assert answer["reasons"]
    request = {"side": "L", "touches": _touches(), "source": "GP07_Right.csv"}
    assert _ask(service, request)[0] == 409


GOOD: dict[str, Any] = {"side": "L", "touches": {"CL": [1, 2, 3], "MN": [9, 2, 3], "OS": [4, 7, 3]}}


@pytest.mark.parametrize(
    ("body", "said"),
    [
        (b"", "is not JSON"),
        (b"{", "is not JSON"),
        (b"[" * 200_000, "is not JSON"),
        (b"\xff\xfe\x00", "is not JSON"),
        (b'{"side": "L", "touches": {"MN": [NaN, 1, 2]}}', "NaN is not a JSON number"),
        (b'{"side": "L", "touches": {"MN": [1, 1, 2], "MN": [1, 1, 2]}}', "'MN' is given twice"),
        ([], "must be a JSON object"),
        ({"touches": {}}, "lacks 'side'"),
        ({**GOOD, "speed": 3}, "has no 'speed'"),
        ({**GOOD, "side": "X"}, "side"),
        ({**GOOD, "side": 1}, "side must be a text"),
        ({**GOOD, "touches": [1]}, "touches must be a JSON object"),
        ({**GOOD, "touches": {"MN": 3}}, "each touch must be"),
        ({**GOOD, "touches": {"MN": [1, 2]}}, "three finite numbers"),
        ({**GOOD, "touches": {"MN": [[1, 2, 3], [1]]}}, "(N, 3)"),
        ({**GOOD, "touches": {"QQ": [1, 2, 3]}}, "unknown feature"),
        ({**GOOD, "touches": {"MN": [[1, 2, 3]] * 20_000}}, "more than 10000"),
        ({**GOOD, "method": "magic"}, "method must be one of"),
        ({**GOOD, "method": "jrmpc"}, "labelled specimens"),
        ({**GOOD, "shared_error_mm": "a"}, "must be a number"),
        ({**GOOD, "probe_noise_mm": 10**400}, "too large a number"),
        ({**GOOD, "times_s": 3}, "times_s must be a JSON object"),
        ({**GOOD, "shared_error_mm": 1e9}, "shared error must be"),
        ({**GOOD, "probe_noise_mm": True}, "must be a number"),
        ({**GOOD, "times_s": [1]}, "times_s must be"),
        ({**GOOD, "accept_warnings": 1}, "must be true or false"),
        ({**GOOD, "atlas": {"gpAtlas": 1}}, "atlas"),
        ({**GOOD, "atlas": 7}, "atlas must be"),
        ({"gpPose": 1}, "does not contain"),
        ({"gpPose": 1, "inputs": {"touches": 1}}, "damaged"),
    ],
)
def test_a_wrong_request_is_answered_in_json(service: PoseService, body: Any, said: str) -> None:
    status, answer = _ask(service, body)
    assert (status, answer["status"]) == (400, 2)
    error = answer["error"]
    assert said in " ".join((error["problem"], error.get("landmark", "")))
    assert "Traceback" not in json.dumps(answer)


def test_other_requests_have_statuses_of_their_own(service: PoseService) -> None:
    assert _ask(service, b"", method="GET", path="/")[1]["api"] == 1
    assert _ask(service, b"", method="GET", path="/estimate")[0] == 404
    assert _ask(service, b"{}", path="/other")[0] == 404
    assert _ask(service, b"{}", method="DELETE", path="/")[0] == 405
    assert _ask(service, GOOD, Origin="http://example.org")[0] == 403
    assert _ask(service, GOOD, Host="example.org")[0] == 403
    for length in (b"%d" % (MAX_BYTES + 1), 5000 * b"9"):
        with socket.create_connection(("127.0.0.1", service.port), timeout=10) as sock:
            sock.sendall(b"POST /estimate HTTP/1.1\r\nHost: localhost\r\nContent-Length: %s\r\n\r\n" % length)
            assert b" 413 " in sock.recv(1000)
    with socket.create_connection(("127.0.0.1", service.port), timeout=10) as sock:
        sock.sendall(b"POST /estimate HTTP/1.1\r\nHost: localhost\r\n\r\n")
        assert b" 411 " in sock.recv(1000)
    assert _ask(service, {"side": "L", "touches": _touches()})[0] == 200  # it goes on


def test_it_listens_on_this_machine_only(service: PoseService) -> None:
    assert service.url.startswith("http://127.0.0.1:")
    with pytest.raises(GpError, match="choose another port"):
        PoseService(port=service.port)
    with pytest.raises(GpError, match="port must be"):
        PoseService(port=70_000)


def _matrix(text: str) -> list[list[float]]:
    return [[float(word) for word in line.split()] for line in text.splitlines()]


@pytest.mark.skipif(shutil.which("c++") is None, reason="no C++ compiler")
def test_the_cpp_client(service: PoseService, tmp_path: Path) -> None:
    client = tmp_path / "estimate"
    subprocess.run(["c++", "-std=c++17", CLIENTS / "estimate.cpp", "-o", client], check=True)
    request = {"side": "L", "touches": _touches()}
    done = subprocess.run(
        [client, str(service.port)], input=json.dumps(request), capture_output=True, text=True, check=True
    )
    assert _matrix(done.stdout) == _ask(service, request)[1]["transform"]
    for body, status in (({**request, "source": "GP07_R.csv"}, 3), ({**request, "side": "X"}, 2)):
        refused = subprocess.run(
            [client, str(service.port)], input=json.dumps(body), capture_output=True, text=True, check=False
        )
        assert (refused.returncode, refused.stdout) == (status, "")


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("octave-cli") is None, reason="no GNU Octave")
@pytest.mark.skipif(shutil.which("curl") is None, reason="no curl")
def test_the_octave_client(service: PoseService) -> None:
    words = ["octave-cli", str(CLIENTS / "estimate.m"), str(service.port), str(EXAMPLE), "L"]
    done = subprocess.run(words, capture_output=True, text=True, check=True)
    told = _ask(service, {"side": "L", "touches": _touches()})[1]["transform"]
    assert _matrix(done.stdout) == [pytest.approx(row, abs=1e-9) for row in told]
