"""Logs at addresses: an object store in memory, and a web server of this machine."""

from __future__ import annotations

import socket
import threading
from collections.abc import Iterator
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import fsspec
import pytest

from magcomp.errors import UsageError
from magcomp.fleet.places import find
from magcomp.fleet.row import State
from magcomp.fleet.task import Task, carry_out, digest_of


class Quiet(SimpleHTTPRequestHandler):
    def log_message(self, format: str, *args: object) -> None:  # noqa: A002
        """Say nothing."""


class Server(ThreadingHTTPServer):
    def handle_error(self, request: object, client_address: object) -> None:
        """Say nothing of a client that has what it wanted and hangs up."""


@pytest.fixture
def server(tmp_path: Path) -> Iterator[str]:
    """A web server with what is named as a log."""
    (tmp_path / "a.tlog").write_bytes(bytes(range(256)) * 5000)
    (tmp_path / "b.bin").write_bytes(b"nothing")
    (tmp_path / "c.txt").write_text("not a log")
    web = Server(("127.0.0.1", 0), partial(Quiet, directory=str(tmp_path)))
    thread = threading.Thread(target=web.serve_forever, kwargs={"poll_interval": 0.01})
    thread.start()
    yield f"http://127.0.0.1:{web.server_address[1]}"
    web.shutdown()
    thread.join()
    web.server_close()


def test_a_web_server_is_a_place(server: str, tmp_path: Path) -> None:
    found = find([f"{server}/"])
    assert [log.path for log in found] == [f"{server}/a.tlog", f"{server}/b.bin"]
    assert [log.size for log in found] == [256 * 5000, 7]
    for log in found:
        outcome = carry_out(Task(log))
        assert outcome.digest == digest_of(tmp_path / log.path.rpartition("/")[2])
        assert outcome.rows[0].state == State.UNUSABLE
        assert f"Log {log.path} must" in outcome.rows[0].why
    assert [log.path for log in find([f"{server}/a.tlog"])] == [f"{server}/a.tlog"]


def test_a_log_that_a_server_lacks_is_refused(server: str) -> None:
    with pytest.raises(UsageError, match="must be reachable"):
        find([f"{server}/nowhere/"])


def test_a_server_that_is_not_there_is_not_called_empty() -> None:
    with socket.create_server(("127.0.0.1", 0)) as nobody:
        port = nobody.getsockname()[1]
    with pytest.raises(UsageError, match=r"must be reachable; instead received: .*connect"):
        find([f"http://127.0.0.1:{port}/"])


def test_a_server_without_logs_is_said_to_have_none(server: str, tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    with pytest.raises(UsageError, match="must hold logs; instead there is none"):
        find([f"{server}/empty/"])


def test_an_object_store_is_a_place() -> None:
    store = fsspec.filesystem("memory")
    for name in ("x.tlog", "deep/y.BIN", "z.md"):
        store.pipe(f"/fleet/{name}", b"no log")
    try:
        found = find(["memory://fleet"])
        assert [log.path for log in found] == [
            "memory:///fleet/deep/y.BIN",
            "memory:///fleet/x.tlog",
        ]
        assert all(log.size == 6 and log.stamp for log in found)
        assert [log.path for log in find(["memory://fleet/*.tlog"])] == ["memory:///fleet/x.tlog"]
    finally:
        store.rm("/fleet", recursive=True)
