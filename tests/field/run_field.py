"""Runs a field case: a device as a transcript, and the reactions of daemon, `scan` and `check`.

    run_field.py FOLDER            # exit status 0: as expected, 77: needs a CAN interface
    run_field.py --serve FOLDER    # only the device, for manual tests

README.md beside this file describes the three files of a case."""

import contextlib
import json
import os
import pathlib
import re
import select
import shutil
import socket
import struct
import subprocess
import sys
import tempfile
import threading
import time
import tomllib
import tty

BIN = pathlib.Path(os.environ.get("THERMOCOMP_BIN", "build/release/bin")).resolve()
PATIENCE_S = float(os.environ.get("THERMOCOMP_PATIENCE_S", "30"))
NOT_HERE = 77
PRESETS = pathlib.Path(__file__).resolve().parents[2] / "config" / "devices"


# ---- the device

def crc(data):
    total = 0xFFFF
    for byte in data:
        total ^= byte
        for _ in range(8):
            total = (total >> 1) ^ 0xA001 if total & 1 else total >> 1
    return struct.pack("<H", total)


def can_number(text):
    return struct.pack(">I", int(text, 16) | (0x80000000 if len(text) == 8 else 0))


class Rule:
    """`> PATTERN` or `every SECONDS`, with conditions and actions."""

    def __init__(self, pattern="", every_s=None):
        self.every_s, self.uses, self.steps, self.conditions = every_s, 0, [], []
        expression = b""
        for token in pattern.split():
            if token == "*":
                expression += b".*"
            elif token.endswith("#"):
                expression += re.escape(can_number(token[:-1]))
            else:
                expression += b"." if token == ".." else re.escape(bytes.fromhex(token))
        self.expression = re.compile(expression, re.DOTALL)

    def holds(self, now_s):
        return all({"first": self.uses < number, "from": now_s >= number,
                    "until": now_s < number}[what] for what, number in self.conditions)


class Place:
    """One port, serial line or CAN interface with its rules."""

    def __init__(self, kind, name):
        self.kind, self.name, self.rules, self.memory = kind, name, [], {}
        self.second_client, self.busy = "serve", contextlib.nullcontext()
        self.asked_at, self.links, self.running = None, [], True
        self.requests = []

    # parsing of the transcript

    def bytes_of(self, text, request):
        out = b""
        for token in text.split():
            if token == "crc":
                out += crc(out)
            elif token[0] == "$":
                out += self.memory[token[1:]]
            elif token[0] == "@":
                first, _, last = token[1:].partition("-")
                out += request[int(first):int(last or first) + 1]
            elif token.endswith("#"):
                out += can_number(token[:-1])
            else:
                out += bytes.fromhex(token)
        return out

    def run(self, rule, request, send):
        """False: the connection is to be closed."""
        rule.uses += 1
        for verb, text in rule.steps:
            if verb == "<":
                send(self.bytes_of(text, request))
            elif verb == "wait":
                time.sleep(float(text))
            elif verb == "set":
                name, _, value = text.partition("=")
                self.memory[name.strip()] = self.bytes_of(value, request)
            elif verb == "close":
                return False
        return True

    def take(self, buffer, send, whole=False):
        """Answers requests at the front of the buffer; returns the rest, or None: to be closed."""
        while buffer:
            self.asked_at = self.asked_at or time.monotonic()
            now_s = time.monotonic() - self.asked_at
            found = next(((rule, match) for rule in self.rules
                          if rule.every_s is None and rule.holds(now_s) and
                          (match := rule.expression.match(buffer))), None)
            if found is None:
                longest = max((len(rule.expression.pattern) for rule in self.rules), default=0)
                return b"" if whole or len(buffer) > longest else buffer
            rule, match = found
            request, buffer = buffer[:match.end()], buffer[match.end():]
            self.requests.append(request)
            with self.busy:
                if not self.run(rule, request, send):
                    return None
        return buffer

    # device

    def open(self, folder):
        if self.kind == "tcp":
            self.server = socket.create_server(("127.0.0.1", 0))
            self.address = str(self.server.getsockname()[1])
            self.start(self.accept)
        elif self.kind == "udp":
            self.server = socket.socket(type=socket.SOCK_DGRAM)
            self.server.bind(("127.0.0.1", 0))
            self.address = str(self.server.getsockname()[1])
            self.start(self.serve_datagrams)
        elif self.kind == "serial":
            self.server, line = os.openpty()
            tty.setraw(line)
            self.address = str(folder / self.name)
            with contextlib.suppress(FileNotFoundError):
                os.unlink(self.address)
            os.symlink(os.ttyname(line), self.address)
            self.start(self.serve_line)
        else:
            self.address = os.environ.get("THERMOCOMP_CAN", "vcan0")
            try:
                self.server = socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
                self.server.bind((self.address,))
            except OSError:
                print("needs the CAN interface", self.address)
                sys.exit(NOT_HERE)
            self.start(self.serve_frames)
        for rule in self.rules:
            if rule.every_s is not None:
                self.start(self.repeat, rule)

    def start(self, body, *arguments):
        threading.Thread(target=body, args=arguments, daemon=True).start()

    def accept(self):
        while True:
            try:
                link, _ = self.server.accept()
            except OSError:
                return
            link.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            if self.links and self.second_client == "refuse":
                link.close()
                continue
            if self.links and self.second_client == "replace":
                with contextlib.suppress(OSError):  # may exit by itself
                    self.links.pop().shutdown(socket.SHUT_RDWR)
            self.links.append(link)
            self.start(self.serve_link, link)

    def serve_link(self, link):
        buffer = b""
        with contextlib.suppress(OSError), link:
            while buffer is not None and (piece := link.recv(4096)):
                buffer = self.take(buffer + piece, link.sendall)
            if link in self.links:
                self.links.remove(link)
        if link in self.links:
            self.links.remove(link)

    def serve_datagrams(self):
        with contextlib.suppress(OSError):
            while self.running:
                piece, sender = self.server.recvfrom(4096)
                self.take(piece, lambda data: self.server.sendto(data, sender), whole=True)

    def serve_line(self):
        buffer = b""
        while self.running:
            if select.select([self.server], [], [], 0.1)[0]:
                try:
                    buffer = self.take(buffer + os.read(self.server, 4096),
                                       lambda data: os.write(self.server, data)) or b""
                except OSError:  # not open anywhere
                    time.sleep(0.02)

    def send_frame(self, data):
        number, = struct.unpack(">I", data[:4])
        self.server.send(struct.pack("=IB3x8s", number, len(data) - 4, data[4:].ljust(8, b"\0")))

    def serve_frames(self):
        while self.running:
            if select.select([self.server], [], [], 0.1)[0]:
                number, size, data = struct.unpack("=IB3x8s", self.server.recv(16))
                self.take(struct.pack(">I", number) + data[:size], self.send_frame, whole=True)

    def repeat(self, rule):
        begun = time.monotonic()
        while self.running:
            if rule.holds(time.monotonic() - begun):
                self.run(rule, b"", self.send_frame if self.kind == "can" else
                         lambda data: os.write(self.server, data))
            time.sleep(rule.every_s)

    def close(self):
        self.running = False
        if self.kind == "serial":
            return  # for a thread that checks `running`; closed by the end of the process
        with contextlib.suppress(OSError):
            if self.kind == "tcp":
                self.server.shutdown(socket.SHUT_RDWR)
        self.server.close()
        for link in self.links:
            with contextlib.suppress(OSError):
                link.shutdown(socket.SHUT_RDWR)


def read_device(path):
    places, rule = [], None
    for number, line in enumerate(path.read_text().splitlines(), 1):
        words = line.split("#!")[0].strip()  # a single `#` is part of a CAN frame
        if not words or words.startswith("# ") or words == "#":
            continue
        verb, _, rest = words.partition(" ")
        rest = rest.strip()
        if verb in ("tcp", "udp", "serial", "can"):
            places.append(Place(verb, rest))
        elif verb == "second":  # second client refuse|replace
            places[-1].second_client = rest.split()[-1]
        elif words == "one request at a time":
            places[-1].busy = threading.Lock()
        elif verb == "let":
            name, _, value = rest.partition("=")
            places[-1].memory[name.strip()] = places[-1].bytes_of(value, b"")
        elif verb == ">":
            rule = Rule(rest)
            places[-1].rules.append(rule)
        elif verb == "every":
            rule = Rule(every_s=float(rest))
            places[-1].rules.append(rule)
        elif verb in ("first", "from", "until"):
            rule.conditions.append((verb, float(rest)))
        elif verb in ("<", "wait", "set", "close"):
            rule.steps.append((verb, rest))
        else:
            raise SystemExit(f"{path}:{number}: {verb}: not known")
    return places


# ---- the daemon's configuration

def whole_config(text, folder):
    """The case's file completed by model, blocks, an axis and socket."""
    known = tomllib.loads(text)
    names = [sensor["name"] for sensor in known.get("sensor", [])]
    if "block" not in known:
        text += "".join(f'[[block]]\nname = "{name}"\ninput = "{name}_degC"\n'
                        f'sensors = ["{name}"]\n' for name in names)
    inputs = [block["input"] for block in tomllib.loads(text).get("block", [])]
    if "model" not in known:
        text += '[model]\nfile = "model.toml"\n'
        (folder / "model.toml").write_text(
            f'format = 1\ninputs = {json.dumps(inputs)}\noutputs = ["z_um"]\n'
            f"reference = {[20.0] * len(inputs)}\nmatrix_um_per_K = [{[-1.0] * len(inputs)}]\n")
    if "controller" not in known:
        text += '[controller]\nname = "none"\nkind = "dry_run"\n'
    if "axis" not in known:
        text += '[[axis]]\nname = "z"\noutput = "z_um"\n' \
                "offset_um_max = 40.0\nrate_um_per_s_max = 2.0\n"
    if "screening" not in known:
        text += "[screening]\nsettle_s = 1.0\n"
    if "compensation" not in known:
        text += "[compensation]\nenabled_at_first_start = true\n"
    return (f'format = 1\nstate_file = "{folder}/state.json"\n' + text +
            f'[history]\nenabled = false\n[socket]\npath = "{folder}/s"\n')


# ---- the outputs

class Case:
    def __init__(self, folder):
        self.folder, self.wrong = folder, []
        self.expected = tomllib.loads((folder / "expected.toml").read_text())
        self.box = tempfile.TemporaryDirectory(prefix="field_", ignore_cleanup_errors=True)
        self.room = pathlib.Path(self.box.name)
        for each in folder.rglob("*"):
            if each.is_file():
                target = self.room / each.relative_to(folder)
                target.parent.mkdir(parents=True, exist_ok=True)
                shutil.copy(each, target)
        (self.room / "devices").symlink_to(PRESETS)
        self.device = folder / self.expected.get("device", "device.txt")
        self.config = self.room / "config.toml"
        self.faults, self.is_well, self.beside = {}, None, ""

    @contextlib.contextmanager
    def with_device(self):
        places = read_device(self.device) if self.device.exists() else []
        text = (self.folder / "config.toml").read_text()
        for place in places:
            place.open(self.room)
            text = text.replace(f"@{place.name}@", place.address)
        self.config.write_text(whole_config(text, self.room))
        try:
            yield places
        finally:
            for place in places:
                place.close()

    def tool(self, *arguments):
        done = subprocess.run([str(BIN / "thermocomp"), *map(str, arguments)], text=True,
                              capture_output=True, timeout=300, cwd=self.room)
        return done.returncode, done.stdout, done.stderr

    def compare(self, who, what, expected, seen):
        if expected != seen:
            self.wrong.append(f"{who}: {what}: expected {expected!r}, came {seen!r}")

    @staticmethod
    def is_near(shown, value):
        with contextlib.suppress(TypeError, ValueError):
            return abs(float(shown) - value) <= 0.06
        return False

    def words(self, who, wanted, text):
        self.wrong += [f"{who}: does not say {word!r}" for word in wanted.get("words", [])
                       if word not in text]
        self.wrong += [f"{who}: says {word!r}" for word in wanted.get("not_words", [])
                       if word in text]

    # the three programs

    def check(self):
        wanted = self.expected["check"]
        with self.with_device():
            status, out, errors = self.tool("check", self.config)
        print("---- check\n" + out + errors)
        self.compare("check", "exit status", wanted.get("exit", 0), status)
        self.words("check", wanted, out + errors)

    def scan(self):
        wanted = self.expected["scan"]
        arguments = ["scan", self.config, *wanted.get("arguments", [])]
        with self.with_device():
            status, out, errors = self.tool(*arguments)
        print("---- scan\n" + out + errors)
        self.compare("scan", "exit status", wanted.get("exit", 0), status)
        if self.is_well is not None:
            self.compare("scan", "exit status beside the daemon's", 0 if self.is_well else 1, status)
            print(f"BESIDE {self.folder.name}: {self.beside}; scan {status}")
        self.words("scan", wanted, out + errors)
        shown = dict(re.findall(r"^    (\w+) .* -> (\S+)", out, re.M))
        for name, value in wanted.get("values", {}).items():
            if not self.is_near(shown.get(name), value):
                self.wrong.append(f"scan: {name}: expected {value}, came {shown.get(name)}")
        for name, fault in self.faults.items():  # as used by the daemon
            if fault == "unconfirmed":  # the daemon stopped within its settle_s; a scan has no history
                continue
            output = shown.get(name, "nothing")
            output = "none" if re.fullmatch(r"-?\d.*", output) else output
            self.compare("scan", name + " beside the daemon", fault, output)

    def daemon(self):
        wanted = self.expected["daemon"]
        log = self.room / "log"
        with self.with_device() as places, log.open("w") as sink:
            process = subprocess.Popen([str(BIN / "thermocompd"), str(self.config)],
                                       stdin=subprocess.DEVNULL, stdout=sink, stderr=sink,
                                       cwd=self.room)
            try:
                self.watch(wanted, process, log)
            finally:
                process.terminate()
                ended = process.wait(60)
                print("---- daemon\n" + log.read_text())
                for place in places:
                    print(f"{place.name}: {len(place.requests)} requests, the last",
                          place.requests[-1].hex(" ") if place.requests else "none")
        self.compare("daemon", "exit status", wanted.get("exit", 0), ended)

    def watch(self, wanted, process, log):
        if wanted.get("exit", 0) != 0:
            process.wait(PATIENCE_S)
            return self.words("daemon", wanted, log.read_text())
        end = time.monotonic() + wanted.get("patience_s", PATIENCE_S)
        while (wrong := self.differs(wanted, log)) and time.monotonic() < end:
            if process.poll() is not None:
                break
            time.sleep(0.1)
        begun, before = time.monotonic(), self.answers() if not wrong else {}
        hold_s = wanted.get("hold_s", 0)
        while not wrong and time.monotonic() < begun + hold_s:
            time.sleep(0.1)
            wrong = self.differs(wanted, log)
        self.wrong += wrong
        if wrong or not hold_s:
            return
        passed_s = time.monotonic() - begun
        now = self.answers()
        for device, rate in wanted.get("answers_per_s", {}).items():
            seen = (now[device] - before[device]) / passed_s
            print(f"{device}: {seen:.3f} answers a second")
            if seen < rate:
                self.wrong.append(f"daemon: {device}: {seen} answers a second, not {rate}")
        lines = len(log.read_text().splitlines())
        if lines > wanted.get("log_lines_max", lines):
            self.wrong.append(f"daemon: {lines} lines of log, not {wanted['log_lines_max']}")

    def call(self, method):
        with socket.socket(socket.AF_UNIX) as link:
            link.settimeout(PATIENCE_S)
            link.connect(str(self.room / "s"))
            link.sendall(json.dumps({"jsonrpc": "2.0", "id": 1, "method": method}).encode() +
                         b"\n")
            with link.makefile("r") as lines:
                return json.loads(lines.readline())["result"]

    def answers(self):
        return {unit["name"]: unit["answers"] for bus in self.call("status")["buses"]
                for unit in bus["units"]}

    def differs(self, wanted, log):
        """Current differences from the expectations."""
        kept, self.wrong = self.wrong, []
        try:
            status, sensors = self.call("status"), self.call("sensors")["sensors"]
        except (OSError, KeyError, ValueError) as error:
            self.wrong = kept
            return [f"daemon: no status: {error!r}"]
        exit_status, text, _ = self.tool("--socket", self.room / "s", "status")
        seen = {sensor["name"]: sensor for sensor in sensors}
        self.faults = {name: sensor["fault"] for name, sensor in seen.items()}
        for name, value in wanted.get("values", {}).items():
            raw, fault = seen[name]["raw_degC"], seen[name]["fault"]
            if fault != "none" or not self.is_near(raw, value):
                self.wrong.append(f"daemon: {name}: expected {value}, came {raw}, {fault}")
        for name, fault in wanted.get("faults", {}).items():
            self.compare("daemon", name, fault, seen[name]["fault"])
        for name, offset in wanted.get("applied_um", {}).items():
            applied = next(axis for axis in status["axes"] if axis["name"] == name)["applied"]
            if applied is None or abs(applied - offset) > 0.2:
                self.wrong.append(f"daemon: applied of {name}: expected {offset}, came {applied}")
        if "mode" in wanted:
            self.compare("daemon", "mode", wanted["mode"], status["mode"])
        for reason in wanted.get("reasons", []):
            if reason not in status["reasons"]:
                self.wrong.append(f"daemon: no reason {reason}: {status['reasons']}")
        # Cases without a controller may be well in dry run.
        self.beside = f"status {exit_status} {status['mode']} {','.join(status['reasons']) or '-'}"
        self.is_well = exit_status == 0 or (status["mode"] == "dry_run" and not status["reasons"])
        if "scan" in self.expected:  # its exit status says the same; a daemon that has just started may not yet
            self.compare("daemon", "is well", self.expected["scan"].get("exit", 0) == 0, self.is_well)
        if "status_exit" in wanted:
            self.compare("daemon", "exit status of `status`", wanted["status_exit"], exit_status)
        output = log.read_text() + json.dumps(status, ensure_ascii=False) + text
        self.words("daemon", wanted, output)
        self.output = output
        found, self.wrong = self.wrong, kept
        return found

    def run(self):
        for program in ("check", "daemon", "scan"):
            if program in self.expected:
                getattr(self, program)()
        for line in self.wrong:
            print("WRONG", line)
        if self.wrong and "daemon" in self.expected:
            print("---- status\n" + getattr(self, "output", ""))
        return 1 if self.wrong else 0


def main():
    case = Case(pathlib.Path(sys.argv[-1]).resolve())
    if sys.argv[1] == "--serve":
        with case.with_device() as places:
            print(case.config, *(f"{place.name} = {place.address}" for place in places))
            threading.Event().wait()
    sys.exit(case.run())


if __name__ == "__main__":
    main()
