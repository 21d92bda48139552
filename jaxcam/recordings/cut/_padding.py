"""Pad arrays to a few lengths for compiled programs."""

import numpy as np


def padded(array, block: int = 64) -> np.ndarray:
    """Extend an array along its first axis by repeating its last entry.

    Lengths are rounded up to `block` times a power of four. A program is compiled again
    for each length, which takes far longer than running it on additional entries.
    """
    array = np.asarray(array)
    length = block
    while length < len(array):
        length *= 4
    if len(array) == 0:
        return np.zeros((length, *array.shape[1:]), array.dtype)
    repeats = np.repeat(array[-1:], length - len(array), axis=0)
    return np.concatenate([array, repeats])
