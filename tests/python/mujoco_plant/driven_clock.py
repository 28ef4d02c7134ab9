"""The clock of a program that runs under tests/src/driven_clock.c."""

import ctypes
import mmap
import time


class DrivenClock:
    """From now on CLOCK_MONOTONIC stands still there, wherever it is set; from `release` on it goes as everywhere."""

    def __init__(self, path):
        with open(path, "r+b") as file:
            self.memory = mmap.mmap(file.fileno(), 8)
        self.now = ctypes.c_uint64.from_buffer(self.memory)
        self.set(time.clock_gettime_ns(time.CLOCK_MONOTONIC))

    def set(self, now_ns):
        """An instant in ns, not earlier than the last."""
        self.now.value = now_ns

    def release(self):
        """Lets the clock go."""
        self.now.value = 0
