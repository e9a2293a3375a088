"""Addresses, as settings and requests tell them."""

import ipaddress
from contextlib import suppress
from urllib.parse import urlsplit

from .errors import StartError

Network = ipaddress.IPv4Network | ipaddress.IPv6Network

IPV6_SITE = 64
"""Bits of an IPv6 address that a caller does not choose."""
USUAL_PORTS = {"http": 80, "https": 443}


def is_loopback(host: str) -> bool:
    """Whether only this machine reaches the address."""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def in_brackets(host: str) -> str:
    """A host as addresses and the Host header write it: of IPv6 in brackets."""
    return f"[{host}]" if host.count(":") > 1 and not host.startswith("[") else host


def without_port(host: str) -> str:
    """The name in a Host header."""
    name, colon, port = host.rpartition(":")
    return name if colon and port.isdigit() else host


def origin(url: str) -> str:
    """Scheme, host and port of RIDETUNE_PUBLIC_URL, as browsers write them."""
    if not url:
        return ""
    with suppress(ValueError):
        parts = urlsplit(url.strip().lower())
        usual, more = USUAL_PORTS.get(parts.scheme), parts.path.strip("/") + parts.query
        if usual and parts.hostname and not more:
            port = "" if parts.port in (None, usual) else f":{parts.port}"
            return f"{parts.scheme}://{in_brackets(parts.hostname)}{port}"
    raise StartError(
        f"RIDETUNE_PUBLIC_URL is {url!r}; give scheme and host of the whole service, such as "
        "https://ride.example.com."
    )


def networks(text: str) -> tuple[Network, ...]:
    """What RIDETUNE_PROXY_ADDRESSES lists: addresses and networks, by commas."""
    stated = [part.strip() for part in text.split(",") if part.strip()]
    try:
        return tuple(ipaddress.ip_network(part) for part in stated)
    except ValueError as error:
        raise StartError(
            f"RIDETUNE_PROXY_ADDRESSES: {error}; list addresses or networks such as 10.0.0.0/24."
        ) from None


def is_in(address: str, listed: tuple[Network, ...]) -> bool:
    """Whether an address is one of those listed."""
    try:
        found = ipaddress.ip_address(address)
    except ValueError:
        return False
    if isinstance(found, ipaddress.IPv6Address) and found.ipv4_mapped:
        found = found.ipv4_mapped
    return any(found in network for network in listed)


def site(host: str) -> str:
    """What of an address a caller does not choose: of IPv6 the network."""
    try:
        address = ipaddress.ip_address(host)
    except ValueError:
        return host
    if address.version == 6:
        return str(ipaddress.ip_network((address, IPV6_SITE), strict=False))
    return host
