"""Publishes the running job on a Unix socket: one JSON line per snapshot, a few per second; takes orders back.

Whoever may open the socket may watch. Orders come from the holder of the lease only (lease.py). A watcher that does
not read is dropped; nothing here can hold up the sending loop.
"""

from __future__ import annotations

import contextlib
import json
import os
import selectors
import socket
import struct
import threading
from collections.abc import Callable
from pathlib import Path

from dnc.service.lease import Lease
from dnc.service.snapshot import JobView
from dnc.stream import Command

_PERIOD_S = 0.25
_WATCHERS_MAX = 16
_ORDER_MAX_BYTES = 4096


def socket_path(folder: Path, job_id: str) -> Path:
    """Where a job of this id is published."""
    return folder / f"job-{job_id}.sock"


class Publisher:
    """A daemon thread with one socket; `close` sends the last snapshot and removes the socket."""

    def __init__(self, folder: Path, view: JobView, command: Callable[[Command], None]) -> None:
        self.path = socket_path(folder, view.names.job_id)
        self._view = view
        self._lease = Lease(command, lambda: view.sender.state)
        self._selector = selectors.DefaultSelector()
        self._watchers: dict[socket.socket, bytearray] = {}
        self._is_closing = threading.Event()
        self._wake_read, self._wake_write = os.pipe2(os.O_NONBLOCK | os.O_CLOEXEC)
        self._thread = threading.Thread(target=self._run, name="publisher", daemon=True)
        self._listener: socket.socket | None = None

    def start(self) -> bool:
        """Open the socket; a folder that cannot be written means that nobody can watch, not that nothing is sent."""
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True, mode=0o750)
            listener = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM | socket.SOCK_NONBLOCK)
            # Under its own name only when it listens with its rights: whoever finds it can connect.
            unheard = self.path.with_name(f".{self.path.name}")
            _bind(listener, unheard)
            unheard.chmod(0o660)
            listener.listen(8)
            unheard.rename(self.path)
        except OSError:
            return False
        self._listener = listener
        self._selector.register(listener, selectors.EVENT_READ)
        self._selector.register(self._wake_read, selectors.EVENT_READ)
        self._thread.start()
        return True

    def close(self) -> None:
        """Publish the end and go."""
        if self._listener is None:
            return
        self._is_closing.set()
        os.write(self._wake_write, b"!")
        self._thread.join(2.0)
        with contextlib.suppress(OSError):
            self.path.unlink()

    def _run(self) -> None:
        while not self._is_closing.is_set():
            for key, _ in self._selector.select(_PERIOD_S if self._watchers else 1.0):
                self._serve(key.fileobj)
            self._publish()
        self._publish()
        for watcher in list(self._watchers):
            self._drop(watcher)
        if self._listener is not None:
            self._listener.close()
        self._selector.close()
        os.close(self._wake_read)
        os.close(self._wake_write)

    def _serve(self, source: object) -> None:
        if source is self._listener:
            self._accept()
        elif isinstance(source, socket.socket):
            self._hear(source)

    def _accept(self) -> None:
        assert self._listener is not None
        with contextlib.suppress(OSError):
            watcher, _ = self._listener.accept()
            watcher.setblocking(False)
            if len(self._watchers) >= _WATCHERS_MAX or not _is_allowed(watcher):
                watcher.close()
                return
            self._watchers[watcher] = bytearray()
            self._selector.register(watcher, selectors.EVENT_READ)

    def _hear(self, watcher: socket.socket) -> None:
        try:
            data = watcher.recv(_ORDER_MAX_BYTES)
        except BlockingIOError:
            return
        except OSError:
            data = b""
        pending = self._watchers[watcher]
        pending += data
        if not data or len(pending) > _ORDER_MAX_BYTES:
            self._drop(watcher)
            return
        while watcher in self._watchers and (end := pending.find(b"\n")) >= 0:
            answer = self._lease.order(id(watcher), bytes(pending[:end]))
            del pending[: end + 1]
            self._send(watcher, answer)

    def _publish(self) -> None:
        if self._watchers:
            line = {**self._view.snapshot(), "lease": self._lease.is_held}
            for watcher in list(self._watchers):
                self._send(watcher, line)

    def _send(self, watcher: socket.socket, values: dict[str, object]) -> None:
        data = json.dumps(values).encode() + b"\n"
        try:
            if watcher.send(data) < len(data):
                self._drop(watcher)
        except OSError:
            self._drop(watcher)

    def _drop(self, watcher: socket.socket) -> None:
        if self._watchers.pop(watcher, None) is None:
            return
        self._lease.release(id(watcher))
        with contextlib.suppress(KeyError, ValueError):
            self._selector.unregister(watcher)
        watcher.close()


def _bind(listener: socket.socket, path: Path) -> None:
    """Bind by the folder's descriptor: the path of a socket may hold 107 bytes only, a user's folders more."""
    folder = os.open(path.parent, os.O_PATH | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        listener.bind(f"/proc/self/fd/{folder}/{path.name}")
    finally:
        os.close(folder)


def _is_allowed(watcher: socket.socket) -> bool:
    """Only the user who sends, his group by the socket's rights, and root."""
    data = watcher.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, struct.calcsize("3i"))
    _, user, group = struct.unpack("3i", data)
    return user in (0, os.getuid()) or group in (os.getgid(), *os.getgroups())
