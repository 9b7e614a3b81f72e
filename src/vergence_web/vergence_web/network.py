"""The addresses of this machine, for the URLs that other machines open."""

import socket

_ELSEWHERE = (("192.0.2.1", socket.AF_INET), ("2001:db8::1", socket.AF_INET6))
"""Addresses of documentation (RFC 5737, RFC 3849): nothing is sent there."""


def own_addresses() -> list[str]:
    """Return this machine's name and the addresses from which it would send to other networks."""
    found = [socket.gethostname()]
    for address, family in _ELSEWHERE:
        try:
            with socket.socket(family, socket.SOCK_DGRAM) as probe:
                probe.connect((address, 9))  # chooses a route; a datagram socket sends nothing yet
                found.append(str(probe.getsockname()[0]))
        except OSError:
            continue
    return found
