"""Keep traced and compiled programs, and discard them on demand."""

import contextlib
import gc
import threading
import weakref
from collections.abc import Callable, Hashable
from typing import Any

import jax


_ALL: "weakref.WeakSet[Cache | Latest]" = weakref.WeakSet()


class Cache:
    """A cache of results by key; beyond a maximum number, the oldest are discarded.

    **Arguments:** the maximum number of results.
    """

    def __init__(self, most: int = 256):
        self._most = most
        self._results: dict[Hashable, Any] = {}
        # a user's function may itself run a simulation while it is traced
        self._lock = threading.RLock()
        _ALL.add(self)

    def get(self, key: Hashable, make: Callable[[], Any], keeps=lambda made: True):
        """Return the result for a key. If there is none yet, `make` creates one, which
        is kept if `keeps(result)` is true.

        **Raises:** `TypeError` if the key is not hashable.
        """
        with self._lock:
            if key in self._results:
                return self._results[key]
            with _COLLECTOR.suspended():
                made = make()
            if keeps(made):
                self.keep(key, made)
            return made

    def find(self, key: Hashable) -> Any:
        """Return the result for a key, or `None`."""
        with self._lock:
            return self._results.get(key)

    def keep(self, key: Hashable, result: Any) -> None:
        """Keep the result for a key."""
        with self._lock:
            while len(self._results) >= self._most:
                del self._results[next(iter(self._results))]
            self._results[key] = result

    def clear(self) -> None:
        """Discard all results."""
        with self._lock:
            self._results.clear()


class _Collector:
    """The garbage collector, suspended while any thread traces a program: nearly all of
    the many new objects are kept, and searching them takes a tenth of the time.
    """

    def __init__(self):
        self._lock, self._depth, self._enabled = threading.Lock(), 0, False

    @contextlib.contextmanager
    def suspended(self):
        with self._lock:
            if self._depth == 0:
                self._enabled = gc.isenabled()
                gc.disable()
            self._depth += 1
        try:
            yield
        finally:
            with self._lock:
                self._depth -= 1
                if self._depth == 0 and self._enabled:
                    gc.enable()


_COLLECTOR = _Collector()


class Latest:
    """A cache of one result, for an object that is passed several times in a row."""

    def __init__(self):
        self._latest: tuple[Any, Any] = (None, None)
        _ALL.add(self)

    def get(self, one: object) -> Any:
        """Return the result kept for this very object, or `None` if there is none."""
        latest, result = self._latest
        return result if latest is one else None

    def keep(self, one: object, result: Any) -> None:
        """Keep the result for an object, and discard the previous result."""
        self._latest = (one, result)

    def clear(self) -> None:
        """Discard the result."""
        self._latest = (None, None)


def clear_caches() -> None:
    """Discard all programs that jaxcam and JAX have compiled in this process.

    Call this function after you have replaced a method of a class, or a global value
    that a method reads, because compiled programs still contain the old one. Programs
    on disk are kept, because they are looked up by their content.

    Examples:
        >>> import jaxcam
        >>> jaxcam.clear_caches()
    """
    for cache in list(_ALL):
        cache.clear()
    jax.clear_caches()
