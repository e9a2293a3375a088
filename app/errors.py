"""Errors of the service itself, each with its status; the sentence is for a person.

Engine errors are what the caller can mend, hence 422; these state their own status.
`problems.py` turns both into replies.
"""

from ..engine.errors import RideError


class StartError(RideError):
    """The service cannot start as it is set up."""

    code = "start"


class BackupError(RideError):
    """A backup cannot be made, or not be restored."""

    code = "backup"


class ServiceError(RideError):
    """A request that the service itself refuses; `field` is the place in it where there is one."""

    status: int

    def __init__(self, message: str, *, field: str | None = None, retry_after: int | None = None):
        super().__init__(message)
        self.field = field
        self.headers = {} if retry_after is None else {"Retry-After": str(retry_after)}


class InvalidRequest(ServiceError):
    """The request can be read, but parts of it are missing or contradict each other."""

    code, status = "invalid-request", 422


class Forbidden(ServiceError):
    """The request comes from where none may come from, or without the token."""

    code, status = "forbidden", 403


class UnknownKey(ServiceError):
    """The bearer has the form of an API key and is none, or none any more."""

    code, status = "unknown-key", 401

    def __init__(self):
        super().__init__(
            "The API key that was sent is not known, or was removed; send one that `ridetune keys "
            "add` has shown (`ridetune keys list` has the beginnings of those there are)."
        )
        self.headers = {"WWW-Authenticate": "Bearer"}


class NotFound(ServiceError):
    """Nothing by that name in this session."""

    code, status = "not-found", 404


class NotAcceptable(ServiceError):
    """The reply cannot be had in the form asked for."""

    code, status = "not-acceptable", 406


class Conflict(ServiceError):
    """What is asked for contradicts what is under way."""

    code, status = "conflict", 409


class Deleted(ServiceError):
    """A recording that is still needed is no more; asking again is of no use."""

    code, status = "deleted", 410


class TooLarge(ServiceError):
    """A body, a file or a result over the limit."""

    code, status = "too-large", 413


class OverBudget(ServiceError):
    """Work that would take more than a request may."""

    code, status = "over-budget", 422


class Busy(ServiceError):
    """Too much under way for one session, or too much kept."""

    code, status = "busy", 429


class Unavailable(ServiceError):
    """The service cannot do this just now."""

    code, status = "unavailable", 503


class StorageFull(Unavailable):
    """A disk of the service is full."""

    code, status = "storage-full", 507

    def __init__(self):
        super().__init__(
            "The disk of the service is full and nothing was kept; make room on it, or delete "
            "measurements and jobs, then try again.",
            retry_after=30,
        )


class Compiling(Unavailable):
    """The kernels are not compiled yet."""

    code = "compiling"


def unforeseen(error: BaseException) -> dict[str, str]:
    """What is told of a job that failed by a fault of ours, as its `code` and `detail`."""
    return {
        "code": "internal",
        "detail": f"The job failed unexpectedly ({type(error).__name__}); the service's log has "
        "the details.",
    }
