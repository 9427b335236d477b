"""A network camera: MJPEG over HTTP, each image with its timestamp, as mjpg-streamer sends it."""

from __future__ import annotations

import contextlib
import errno
import socket
import threading

from pipeline.common.errors import BadInput

_BOUNDARY = "image"
_HEAD = (
    "HTTP/1.1 200 OK\r\nCache-Control: no-cache\r\nConnection: close\r\n"
    f"Content-Type: multipart/x-mixed-replace; boundary={_BOUNDARY}\r\n\r\n"
).encode()
_SEND_TIMEOUT_S = 1.0


class CameraServer:
    """Listens on host:port (0: any free one, see ``port``) while it is plugged in. BadInput if the port is taken."""

    def __init__(self, host: str, port: int) -> None:
        self._host = host
        self.port = port
        self._lock = threading.Lock()
        self._clients: list[socket.socket] = []
        self._listener: socket.socket | None = None
        self.plug_in()

    def plug_in(self) -> None:
        """Accept connections (again)."""
        if self._listener is not None:
            return
        listener = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            listener.bind((self._host, self.port))
        except OSError as error:
            listener.close()
            why = "is in use" if error.errno == errno.EADDRINUSE else error.strerror
            raise BadInput(f"camera on {self._host}:{self.port}: {why}") from None
        listener.listen()
        self.port = listener.getsockname()[1]
        self._listener = listener
        threading.Thread(target=self._accept, args=(listener,), name="cipv-replay-camera", daemon=True).start()

    def unplug(self) -> None:
        """Close all connections and accept no more."""
        listener, self._listener = self._listener, None
        if listener is not None:
            with contextlib.suppress(OSError):
                listener.shutdown(socket.SHUT_RDWR)  # wakes the thread that waits in accept
            listener.close()
        with self._lock:
            clients, self._clients = self._clients, []
        for client in clients:
            client.close()

    def send(self, jpeg: bytes, stamp_ns: int) -> None:
        """Send the image to all connected clients."""
        head = (
            f"--{_BOUNDARY}\r\nContent-Type: image/jpeg\r\nContent-Length: {len(jpeg)}\r\n"
            f"X-Timestamp: {stamp_ns / 1e9:.6f}\r\n\r\n"
        ).encode()
        with self._lock:
            clients = list(self._clients)
        for client in clients:
            try:
                client.sendall(head + jpeg + b"\r\n")
            except OSError:
                with self._lock, contextlib.suppress(ValueError):
                    self._clients.remove(client)
                client.close()

    def _accept(self, listener: socket.socket) -> None:
        while True:
            try:
                client, _ = listener.accept()
            except OSError:
                return
            threading.Thread(target=self._greet, args=(client,), daemon=True).start()

    def _greet(self, client: socket.socket) -> None:
        """Answer the request, whatever its path; from then on the client receives images."""
        try:
            client.settimeout(_SEND_TIMEOUT_S)
            client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            asked = b""
            while b"\r\n\r\n" not in asked and len(asked) < 65_536:
                data = client.recv(4096)
                if not data:
                    raise OSError("gone")
                asked += data
            client.sendall(_HEAD)
        except OSError:
            client.close()
            return
        with self._lock:
            self._clients.append(client)
