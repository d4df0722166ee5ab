"""Common parts of the command's tests: running it, and a fake status socket."""
import json
import os
import pathlib
import socket
import subprocess
import tempfile
import threading

import pytest

SOURCE = pathlib.Path(os.environ["THERMOCOMP_SOURCE"])
PROGRAM = os.environ["THERMOCOMP"]


def run(*arguments, program=PROGRAM, env=None, **options):
    """Runs thermocomp; the result has returncode, stdout and stderr."""
    return subprocess.run([program, *map(str, arguments)], capture_output=True, text=True,
                          timeout=120, env={**os.environ, **(env or {})}, **options)


class FakeDaemon:
    """Answers methods of the status socket from a table. A tuple is an error (code, text); a list
    holds consecutive answers, of which the last is repeated."""

    def __init__(self):
        self.folder = tempfile.TemporaryDirectory(prefix="tc")
        self.path = os.path.join(self.folder.name, "s")
        self.answers = {}
        self.requests = []
        self.listener = socket.socket(socket.AF_UNIX)
        self.listener.bind(self.path)
        self.listener.listen()
        threading.Thread(target=self.serve, daemon=True).start()

    def serve(self):
        while True:
            try:
                connection, _ = self.listener.accept()
            except OSError:
                return
            threading.Thread(target=self.talk, args=(connection,), daemon=True).start()

    def talk(self, connection):
        with connection, connection.makefile("rw") as lines:
            for line in lines:
                request = json.loads(line)
                self.requests.append(request)
                answer = self.answers.get(request["method"], {"done": True})
                if isinstance(answer, list):
                    answer = answer.pop(0) if len(answer) > 1 else answer[0]
                reply = {"jsonrpc": "2.0", "id": request["id"]}
                if isinstance(answer, tuple):
                    reply["error"] = {"code": answer[0], "message": answer[1]}
                else:
                    reply["result"] = answer
                lines.write(json.dumps(reply) + "\n")
                lines.flush()
                if request["method"] == "subscribe":
                    for _ in range(3):
                        lines.write(json.dumps({"jsonrpc": "2.0", "method": "status",
                                                "params": self.answers["status"]}) + "\n")
                    lines.flush()

    def close(self):
        self.listener.close()
        self.folder.cleanup()


def status_answer(**changes):
    status = {
        "mode": "compensating", "mode_since_s": 65.0, "compensating_s": 65.0, "enabled": True,
        "reasons": [],
        "version": "0", "uptime_s": 70.0, "cycle": {"count": 7000, "rate_hz": 100.0, "missed": 0},
        "model": {"file": "m.toml", "checksum": "ab" * 32},
        "axes": [{"name": "z", "unit": "um", "displacement": -3.0, "target": 3.0, "offset": 3.0,
                  "applied": None, "measured": None, "synced": True, "driven": True}],
        "inputs": [{"name": "bed_degC", "temp_degC": 22.0, "reference_degC": 21.0, "good": True}],
        "sensors_bad": [], "buses": [], "controller": {"online": True}, "warnings": [],
        "history": {"enabled": False}}
    status.update(changes)
    return status


@pytest.fixture
def daemon():
    fake = FakeDaemon()
    fake.answers["status"] = status_answer()
    yield fake
    fake.close()
