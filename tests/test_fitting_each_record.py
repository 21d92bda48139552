"""Recordings are linearised in threads, after one of them has compiled the program."""

import threading

import jax.numpy as jnp
import numpy as np

import jaxcam
from jaxcam.fitting.engine._each_record import each_record


def _calls(args, records=4):
    """The numbers in the order in which calls began, and which of them overlapped."""
    order, running, overlapped = [], set(), set()
    lock = threading.Lock()
    together = threading.Barrier(2)

    def function(row):
        with lock:
            order.append(row)
            running.add(row)
            if len(running) > 1:
                overlapped.update(running)
        try:
            together.wait(timeout=0.2)
        except threading.BrokenBarrierError:
            pass
        with lock:
            running.remove(row)
        return jnp.asarray(float(row))

    found = each_record(function, records, args)
    assert np.array_equal(found, np.arange(records, dtype=float))
    return order, overlapped


def test_the_first_call_of_a_kind_is_alone(monkeypatch):
    """It compiles; a call with arrays of the same shapes does not."""
    monkeypatch.setattr("jaxcam.fitting.engine._each_record._cores", lambda: 2)
    jaxcam.clear_caches()
    order, overlapped = _calls((jnp.zeros(7), "a"))
    assert order[0] == 0 and 0 not in overlapped
    _, overlapped = _calls((jnp.ones(7), "a"))
    assert 0 in overlapped
    for other in ((jnp.zeros(8), "a"), (jnp.zeros(7), "b")):
        assert 0 not in _calls(other)[1]


def test_a_program_that_was_dropped_is_compiled_alone_again(monkeypatch):
    monkeypatch.setattr("jaxcam.fitting.engine._each_record._cores", lambda: 2)
    jaxcam.clear_caches()
    _calls((jnp.zeros(9),))
    jaxcam.clear_caches()
    assert 0 not in _calls((jnp.zeros(9),))[1]
