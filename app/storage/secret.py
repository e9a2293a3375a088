"""Secrets, of which only a hash is kept."""

import hashlib
import secrets
from functools import cache


def new_secret() -> str:
    """A secret that nobody guesses, fit for an address, a cookie or a header."""
    return secrets.token_urlsafe(32)


def hashed(secret: str) -> str:
    """What is kept of a secret. It is random and long, so one plain hash hides it."""
    return hashlib.sha256(secret.encode(errors="replace")).hexdigest()


@cache
def marked(token: str, salt: str) -> str:
    """What tells a token that a person chose from others. It may be short, so it is hashed slowly,
    and elsewhere in another way.
    """
    return hashlib.scrypt(token.encode(), salt=salt.encode(), n=2**14, r=8, p=1, dklen=32).hex()
