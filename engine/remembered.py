"""What is kept in memory because it is asked for again: the most recently used, up to a size."""

import threading
from collections import OrderedDict
from collections.abc import Callable, Hashable
from concurrent.futures import Future
from typing import Generic, TypeVar

Key = TypeVar("Key", bound=Hashable)
Kept = TypeVar("Kept")


class Remembered(Generic[Key, Kept]):
    """Things by key, at most `most` of their sizes together, or one; for any thread."""

    def __init__(self, most: int):
        self._most = most
        self._kept: OrderedDict[Key, tuple[Kept, int]] = OrderedDict()
        self._making: dict[Key, Future[Kept]] = {}
        self._lock = threading.Lock()

    def get(self, key: Key) -> Kept | None:
        """What was kept, if it still is."""
        with self._lock:
            if key not in self._kept:
                return None
            self._kept.move_to_end(key)
            return self._kept[key][0]

    def made(self, key: Key, make: Callable[[], Kept], size: Callable[[Kept], int]) -> Kept:
        """What was kept, else what `make` makes, once for all who ask for it meanwhile; an error is
        theirs, too, and is not kept.
        """
        kept = self.get(key)
        if kept is not None:
            return kept
        with self._lock:
            mine: Future[Kept] = Future()
            others = self._making.get(key)
            if others is None:
                self._making[key] = mine
        if others is not None:
            return others.result()
        try:
            # Another may have made it since it was looked for.
            thing = self.get(key)
            if thing is None:
                thing = make()
                self.keep(key, thing, size(thing))
            mine.set_result(thing)
            return thing
        except BaseException as error:
            mine.set_exception(error)
            raise
        finally:
            with self._lock:
                del self._making[key]

    def keep(self, key: Key, thing: Kept, size: int) -> None:
        """Keep one and forget the least recently used ones that are too many."""
        with self._lock:
            self._kept[key] = thing, size
            self._kept.move_to_end(key)
            while len(self._kept) > 1 and sum(size for _, size in self._kept.values()) > self._most:
                self._kept.popitem(last=False)
