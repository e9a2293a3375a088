"""Random secrets, of which only the hash is kept."""

import hashlib
import secrets


def new_secret() -> str:
    """A secret that nobody guesses, fit for an address, a cookie or a header."""
    return secrets.token_urlsafe(32)


def hashed(secret: str) -> str:
    """What is kept of a secret. It is random and long, so one plain hash hides it."""
    return hashlib.sha256(secret.encode(errors="replace")).hexdigest()
