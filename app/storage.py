"""What an error of the file system means to a person."""

import errno
from collections.abc import Iterator
from contextlib import contextmanager

from .errors import StorageFull, Unavailable

FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
NOT_TO_BE_USED = (
    errno.EACCES,
    errno.EIO,
    errno.ENODEV,
    errno.ENOENT,
    errno.ENOTDIR,
    errno.EPERM,
    errno.EROFS,
    errno.ESTALE,
    errno.ETIMEDOUT,
)
OUT_OF_ORDER = (
    "The service's data directory cannot be used; see that it is there, on a disk that works, and"
    " may be written, then try again."
)


def trouble_of(error: OSError) -> Unavailable | None:
    """None for what is no trouble of a disk."""
    if error.errno in FULL:
        return StorageFull()
    if error.errno in NOT_TO_BE_USED:
        return Unavailable(OUT_OF_ORDER, retry_after=30)
    return None


@contextmanager
def files_in_a_sentence() -> Iterator[None]:
    """Tell of files of the data directory that cannot be read or written."""
    try:
        yield
    except OSError as error:
        if (trouble := trouble_of(error)) is None:
            raise
        raise trouble from None
