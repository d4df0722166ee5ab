import shutil

import pytest

from fleet_lab import Store
from postgres import Postgres


MEMORY, ROOM_BYTES = "/dev/shm", 2 << 30


@pytest.fixture(scope="module")
def server():
    """With TLS for network connections. In memory if there is room: a disk needs 10 s to delete its databases."""
    running = Postgres(MEMORY if shutil.disk_usage(MEMORY).free > ROOM_BYTES else None)
    running.require_tls()
    running.start()
    try:
        yield running
    finally:
        running.end()


@pytest.fixture
def store(server, tmp_path, request):
    """An empty store. Processes left by a failed test are ended."""
    opened = Store(server, tmp_path, request.node.name)
    yield opened
    for process in opened.running:
        if process.poll() is None:
            process.kill()
            process.wait()
