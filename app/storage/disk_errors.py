"""What an error of the file system means to a person."""

import errno
from collections.abc import Iterator
from contextlib import contextmanager

from ..errors import StorageFull, Unavailable

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
SHORT = (errno.EAGAIN, errno.EMFILE, errno.ENFILE, errno.ENOMEM)
OUT_OF_ORDER = (
    "The service's data directory cannot be used; see that it is there, on a disk that works, and"
    " may be written, then try again."
)


def trouble_of(error: OSError) -> Unavailable | None:
    """What passes, by itself or once the disk is seen to; None for what is neither."""
    if error.errno in FULL:
        return StorageFull()
    if error.errno in SHORT:
        return Unavailable(
            "The service has too many files open, or too little memory, at the moment; try again"
            " shortly.",
            retry_after=5,
        )
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
