"""The address that the server listens on, and its form as a URL."""

from __future__ import annotations

import errno
import ipaddress
import socket

from pipeline.common.errors import BadInput

LOOPBACK_HOSTS = ("localhost", "127.0.0.1", "::1")
WILDCARDS = ("0.0.0.0", "::")
"""Addresses that mean every interface of this machine."""
DEFAULT_PORT = 8420
_PORTS_TO_TRY = 20
_LAST_PORT = 65535


class PortTaken(BadInput):
    """The requested address is not available; the text says which one and what to do."""


def listen_socket(host: str, port: int, *, strict: bool = False) -> socket.socket:
    """A bound socket on ``port`` or, unless ``strict``, the next free one above it. PortTaken if there is none."""
    if not 0 <= port <= _LAST_PORT:
        raise PortTaken(f"invalid port {port}; expected 0 to {_LAST_PORT}")
    candidates = [port] if strict or port == 0 else range(port, min(port + _PORTS_TO_TRY, _LAST_PORT + 1))
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    for candidate in candidates:
        # asyncio disables Nagle's delay of 40 ms only if the protocol is set explicitly
        bound = socket.socket(family, socket.SOCK_STREAM, socket.IPPROTO_TCP)
        bound.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            bound.bind((host, candidate))
        except OSError as error:
            bound.close()
            if error.errno == errno.EADDRINUSE:
                continue
            raise PortTaken(f"cannot listen on {host}:{candidate}: {error.strerror}") from None
        return bound
    tried = f"port {port}" if len(candidates) == 1 else f"ports {candidates[0]}–{candidates[-1]}"
    raise PortTaken(f"{tried} on {host} taken; choose another with --port")


def is_loopback(host: str) -> bool:
    """Whether an address or name is reachable from this machine only."""
    return host.lower() in LOOPBACK_HOSTS or (is_address(host) and ipaddress.ip_address(host).is_loopback)


def is_address(name: str | None) -> bool:
    """Whether a host is an IP address instead of a name."""
    try:
        ipaddress.ip_address(name or "")
    except ValueError:
        return False
    return True


def reachable(host: str) -> str:
    """The host as a user would write it in an address; for all interfaces, the address of the outgoing one."""
    if host in WILDCARDS:
        probe = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            probe.connect(("192.0.2.1", 9))  # sends nothing: it only asks the system for the route
            host = probe.getsockname()[0]
        except OSError:
            host = socket.gethostname()
        finally:
            probe.close()
    return f"[{host}]" if ":" in host else host
