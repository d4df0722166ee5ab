"""A gateway with its daemon for the tests: process, configuration, plain requests."""

import contextlib
import http.client
import json
import shutil
import socket
import sqlite3
import ssl
import subprocess

from lab import BIN, PATIENCE_S, eventually, free_port


def change(state, changes):
    """Applies changes like the page: objects are merged, other values replace."""
    for key, value in changes.items():
        place = int(key) if isinstance(state, list) else key
        old = state.get(key) if isinstance(state, dict) else state[place]
        if isinstance(value, dict) and isinstance(old, (dict, list)):
            change(old, value)
        else:
            state[place] = value


class Gateway:
    """A running thermocomp-gateway."""

    def __init__(self, lab, daemon, http="", more="", wrapper=()):
        self.folder = lab.folder
        self.wrapper = wrapper  # a command that runs the gateway
        self.config = lab.folder / "gateway.toml"
        self.log = lab.folder / "gateway.log"
        self.context = None  # TLS
        self.process = None
        self.config.write_text(f'format = 1\nmachine = "mill_3"\n[daemon]\n'
                               f'socket = "{daemon.socket}"\n[http]\nport = 0\n{http}\n{more}\n')

    def start(self):
        with self.log.open("a") as log:
            self.process = subprocess.Popen([*self.wrapper, str(BIN / "thermocomp-gateway"), str(self.config)],
                                            stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                                            stderr=log, text=True, cwd=self.folder)
        line = self.process.stdout.readline()
        assert line, "no ready line: " + self.log.read_text()
        self.ready = json.loads(line)
        self.port = self.ready["http"]
        return self

    def connect(self, timeout_s=PATIENCE_S):
        if self.context:
            return http.client.HTTPSConnection("localhost", self.port, timeout=timeout_s,
                                               context=self.context)
        return http.client.HTTPConnection("127.0.0.1", self.port, timeout=timeout_s)

    def ask(self, path, method="GET", body=None, headers=None):
        """(status, headers, bytes)"""
        with contextlib.closing(self.connect()) as link:
            link.request(method, path, body=body, headers=headers or {})
            answer = link.getresponse()
            return answer.status, answer.headers, answer.read()

    def text(self, path, **rest):
        status, _, body = self.ask(path, **rest)
        assert status == 200, (path, status, body)
        return body.decode()

    def json(self, path, **rest):
        return json.loads(self.text(path, **rest))

    def raw(self, request, timeout_s=PATIENCE_S):
        """Sends raw bytes; returns everything received until the gateway closes."""
        with socket.create_connection(("127.0.0.1", self.port), timeout=timeout_s) as link:
            try:
                link.sendall(request)
                link.shutdown(socket.SHUT_WR)
            except TimeoutError:
                raise
            except OSError:
                pass  # closed by the gateway before the end
            answer = b""
            with contextlib.suppress(ConnectionResetError):
                while block := link.recv(65536):
                    answer += block
            return answer

    @contextlib.contextmanager
    def events(self, headers=None):
        """Yields a function that waits for the next state."""
        with contextlib.closing(self.connect()) as link:
            link.request("GET", "/api/events", headers=headers or {})
            answer = link.getresponse()
            assert answer.status == 200
            assert answer.headers["Content-Type"] == "text/event-stream"

            state = {}

            def next_state():
                while True:
                    line = answer.readline()
                    assert line, "the stream ended"
                    if line.startswith(b"event: state"):
                        state.clear()
                    if line.startswith(b"data: "):
                        change(state, json.loads(line[6:]))
                        return state

            yield next_state

    def wait_for(self, check, what):
        """Waits for the first state of the stream that satisfies check()."""
        with self.events() as next_state:
            return eventually(lambda: next(filter(check, [next_state()]), None), what)

    def end(self):
        self.process.terminate()
        assert self.process.wait(PATIENCE_S) == 0, self.log.read_text()


def make_certificate(folder, name="gateway", subject="localhost"):
    """A self-signed certificate: (certificate, key)."""
    certificate, key = folder / (name + ".crt"), folder / (name + ".key")
    subprocess.run(["openssl", "req", "-x509", "-newkey", "ec", "-pkeyopt",
                    "ec_paramgen_curve:prime256v1", "-nodes", "-days", "2", "-subj",
                    "/CN=" + subject, "-addext", "subjectAltName=DNS:" + subject, "-keyout",
                    str(key), "-out", str(certificate)], check=True, capture_output=True)
    return certificate, key


def trusting(certificate):
    return ssl.create_default_context(cafile=str(certificate))


def password_line(user, password):
    return subprocess.run([str(BIN / "thermocomp-gateway"), "--password-line", user],
                          input=password + "\n", text=True, capture_output=True,
                          check=True).stdout


def guarded_gateway(lab, daemon, passwords, commands):
    """With TLS. @param passwords  by user @param commands  lines of [commands]"""
    certificate, key = make_certificate(lab.folder)
    file = lab.folder / "passwords"
    file.write_text("".join(password_line(*each) for each in passwords.items()))
    made = lab.also_end(Gateway(lab, daemon, f'certificate = "{certificate}"\nkey = "{key}"\npasswords = "{file}"',
                                "[commands]\n" + commands))
    made.context = trusting(certificate)
    return made.start()


class Broker:
    """A real mosquitto."""

    def __init__(self, folder, lines="allow_anonymous true\n", tls=""):
        self.port = free_port()
        self.config = folder / "mosquitto.conf"
        self.log = folder / "mosquitto.log"
        self.config.write_text(f"listener {self.port} 127.0.0.1\n{tls}{lines}")
        self.process = None

    def start(self):
        program = shutil.which("mosquitto", path="/usr/sbin:/usr/bin:/usr/local/sbin")
        with self.log.open("a") as log:
            self.process = subprocess.Popen([program, "-v", "-c", str(self.config)],
                                            stdin=subprocess.DEVNULL, stdout=log, stderr=log)

        def answers():
            with contextlib.suppress(OSError):
                socket.create_connection(("127.0.0.1", self.port), 1).close()
                return True

        eventually(answers, "the broker listens")
        return self

    def stop(self):
        self.process.terminate()
        self.process.wait(PATIENCE_S)


class Subscriber:
    """mosquitto_sub: every message as (topic, retained, payload)."""

    def __init__(self, broker, *options):
        self.log = broker.config.parent / f"subscriber{id(self)}.txt"
        with self.log.open("w") as out:
            self.process = subprocess.Popen(
                ["mosquitto_sub", "-h", "localhost", "-p", str(broker.port), "-t",
                 "thermocomp/#", "-q", "1", "-F", "%t %r %p", *options],
                stdin=subprocess.DEVNULL, stdout=out, stderr=subprocess.STDOUT)

    def messages(self):
        found = []
        for line in self.log.read_text().splitlines():
            parts = line.split(" ", 2)
            if len(parts) == 3 and parts[2].startswith("{"):
                found.append((parts[0], parts[1] == "1", json.loads(parts[2])))
        return found

    def wait_for(self, check, what):
        """Waits for a message that satisfies check(topic, retained, payload)."""
        return eventually(lambda: next((m for m in reversed(self.messages()) if check(*m)), None),
                          what)


def stretch_history(history, days):
    """Fills the last `days` of the history with copies of a commit of its last segment, one every 5 s."""
    length_s, commit_s = days * 86400, 5
    with contextlib.closing(sqlite3.connect(history)) as base:
        base.execute("PRAGMA synchronous=OFF")
        segment, period_ns, first = base.execute(
            "SELECT id, period_ns, first_cycle FROM segment ORDER BY id DESC LIMIT 1").fetchone()
        rows = base.execute("SELECT count, records, wall_minus_grid_ns FROM chunk "
                            "WHERE segment = ? ORDER BY number", (segment,)).fetchall()
        count, records, difference = rows[len(rows) // 2]
        base.execute("DELETE FROM chunk WHERE segment = ?", (segment,))
        cycles = commit_s * 10**9 // period_ns
        chunks = length_s // commit_s
        base.executemany(
            "INSERT INTO chunk (segment, number, through_cycle, wall_minus_grid_ns, count, "
            "records, checksum) VALUES (?, ?, ?, ?, ?, ?, NULL)",
            ((segment, i, first + (i + 1) * cycles,
              difference + ((i - len(rows) // 2) * commit_s - length_s) * 10**9, count, records)
             for i in range(chunks)))
        base.execute("UPDATE segment SET last_cycle = ?, wall_ns = wall_ns - ?, checksum = NULL WHERE id = ?",
                     (first + chunks * cycles, length_s * 10**9, segment))
        base.commit()
