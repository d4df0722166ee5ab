"""A cycle that stalls on request."""

import os
import time


class Stall:
    """A context in which the cycle of a daemon with this environment does not run. The daemon waits
    5 s for its cycle."""

    def __init__(self, file):
        self.file = file
        self.environment = {"THERMOCOMP_STALL": str(file),
                            "LD_PRELOAD": os.environ["THERMOCOMP_STALLED_CYCLE"],
                            # Preloaded libraries come before the sanitizer's.
                            "ASAN_OPTIONS": os.environ.get("ASAN_OPTIONS", "") +
                                            ":verify_asan_link_order=0"}

    def __enter__(self):
        self.file.touch()
        time.sleep(0.1)

    def __exit__(self, *_):
        self.file.unlink()
