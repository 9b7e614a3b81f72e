"""Who may open the page: the token of other machines, the Host and the Origin of a request."""

import hmac
import ipaddress
import secrets
from collections.abc import Iterable
from urllib.parse import urlsplit

from vergence_rig.parameters import ParameterError
from vergence_rig.regular_file import FileError, read_regular_file

LEAST_TOKEN = 16
"""Least length of a token: 16 characters of base64 are 96 bits."""
_MOST_TOKEN, _LARGEST_FILE = 256, 4096


def is_loopback(address: str) -> bool:
    """Return whether only this machine can reach an address to listen on. Raises ParameterError for no IP address."""
    if address == "localhost":
        return True
    try:
        return ipaddress.ip_address(address).is_loopback
    except ValueError:
        allowed = "an IP address of this machine, 0.0.0.0 or localhost"
        raise ParameterError("address", address, allowed) from None


def read_token(path: str, address: str) -> str:
    """Return the token of the page: of a file, a new one for an address that others reach, or "" for none.

    Raises ParameterError for a file that holds no usable token.
    """
    if not path:
        return "" if is_loopback(address) else secrets.token_urlsafe(24)
    allowed = f"the path of a file with one line of {LEAST_TOKEN} to {_MOST_TOKEN} letters, digits, - and _"
    try:
        text = read_regular_file(path, _LARGEST_FILE).decode("ascii").strip()
    except (FileError, UnicodeDecodeError) as error:
        raise ParameterError("token_file", path, f"{allowed} ({error})") from error
    if not LEAST_TOKEN <= len(text) <= _MOST_TOKEN or not text.replace("-", "").replace("_", "").isalnum():
        raise ParameterError("token_file", path, allowed)
    return text


class Access:
    """Judges requests. Texts are reasons for a refusal, "" where there is none.

    Args:
        token: what a request has to present; "" for a page of this machine alone.
        address: the address that is listened on.
    """

    def __init__(self, token: str, address: str) -> None:
        self.token = token
        self._address = address

    def knows(self, given: str | None) -> bool:
        """Return whether a token is the right one; the time that it takes says nothing about it."""
        return hmac.compare_digest((given or "").encode(), self.token.encode())

    def host_refusal(self, host: str | None) -> str:
        """Return why a request with this Host header is refused.

        Without a token the name must be this machine's own: a foreign page may have its name resolve to 127.0.0.1 (DNS
        rebinding), and its requests would otherwise pass for the page's.
        """
        name = _name_of(host)
        if self.token or name in (self._address, "localhost") or _is_loopback_address(name):
            return ""
        return f"Host must be localhost or an address of this machine: got {name[:80]!r}"

    @staticmethod
    def origin_refusal(origin: str | None, host: str | None) -> str:
        """Return why a WebSocket of this Origin is refused: only the page itself may open one."""
        if origin and host and urlsplit(origin).netloc.lower() == host.lower() and origin.lower() != "null":
            return ""
        return f"Origin must be that of the page, {(host or '')[:80]!r}: got {(origin or '')[:80]!r}"


def page_urls(address: str, port: int, token: str, own_addresses: Iterable[str]) -> list[str]:
    """Return the URLs at which the page can be opened.

    Args:
        address: that is listened on.
        port: that is listened on.
        token: "" for none.
        own_addresses: of this machine, for 0.0.0.0 and ::.
    """
    every = address in ("0.0.0.0", "::")
    hosts = list(own_addresses) if every else [address]
    query = f"?token={token}" if token else ""
    return [f"http://{f'[{host}]' if ':' in host else host}:{port}/{query}" for host in hosts or ["localhost"]]


def _name_of(host: str | None) -> str:
    try:
        return urlsplit(f"//{host or ''}").hostname or ""
    except ValueError:
        return ""


def _is_loopback_address(name: str) -> bool:
    try:
        return ipaddress.ip_address(name).is_loopback
    except ValueError:
        return False
