"""Bits that flip in stored numbers."""

import ctypes

import numpy as np


def flipped(content, rng):
    """Bytes, or an array, with one bit flipped."""
    found = bytearray(content if isinstance(content, bytes) else content.tobytes())
    found[rng.integers(len(found))] ^= 1 << int(rng.integers(8))
    if isinstance(content, bytes):
        return bytes(found)
    return np.frombuffer(bytes(found), content.dtype).reshape(content.shape)


def flip_bits(struct, count, rng):
    """Bytes of a ctypes structure with one bit flipped, so many times; it is then as it was."""
    sound = bytes(struct)
    for _ in range(count):
        found = flipped(sound, rng)
        ctypes.memmove(ctypes.byref(struct), found, len(found))
        yield found
    ctypes.memmove(ctypes.byref(struct), sound, len(sound))
