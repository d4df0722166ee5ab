"""The status socket: hundreds of clients that are slow, silent, greedy or talk nonsense."""

import contextlib
import resource
import time

import watch
from registry import attack

STATUS = watch.request("status") + b"\n"
ATTACK_S = 3.5
BEFORE_UM = -2.0


def under(rig, assault):
    """The axis moves on and others are answered while `assault(path, until)` runs."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (min(4096, hard), hard))
    if not rig.start(BEFORE_UM):
        return
    rig.machine.wants_um(-20.0)
    assault(rig, time.monotonic() + ATTACK_S)
    rig.follows_again()


def connected(rig, count):
    links = []
    for _ in range(count):
        with contextlib.suppress(OSError):
            links.append(watch.connect(rig.daemon.socket, 10.0))
    return links


def closed(links):
    for link in links:
        link.close()


def sends_what_it_can(link, data):
    link.setblocking(False)
    with contextlib.suppress(OSError):
        while link.send(data):
            pass


@attack(links=("tcp",))
def three_hundred_that_do_not_read(rig):
    """Each asks for all it can and takes no answer."""
    def assault(rig, until):
        links = connected(rig, 300)
        while time.monotonic() < until:
            for link in links:
                sends_what_it_can(link, 50 * STATUS)
            time.sleep(0.05)
        closed(links)
    under(rig, assault)


@attack(links=("tcp",))
def silent_subscribers(rig):
    """200 subscriptions to everything, nothing read."""
    def assault(rig, until):
        links = connected(rig, 200)
        for link in links:
            with contextlib.suppress(OSError):
                link.sendall(watch.request("subscribe", period_s=0.1, methods=[
                    "status", "sensors", "offsets", "timing", "model"]) + b"\n")
        time.sleep(max(0.0, until - time.monotonic()))
        closed(links)
    under(rig, assault)


@attack(links=("tcp",))
def connection_storm(rig):
    """As many connections as there can be, most of them gone at once."""
    def assault(rig, until):
        while time.monotonic() < until:
            links = connected(rig, rig.random.choice((1, 50, 400)))
            for link in links:
                if rig.random.random() < 0.3:
                    sends_what_it_can(link, STATUS)
            closed(links)
    under(rig, assault)


@attack(links=("tcp",))
def slow_clients(rig):
    """A byte at a time, each for ever in the middle of a line."""
    def assault(rig, until):
        links = connected(rig, 200)
        while time.monotonic() < until:
            for link in links:
                with contextlib.suppress(OSError):
                    link.send(rig.random.choice((b"{", b" ", b'"', b"[")))
            time.sleep(0.1)
        closed(links)
    under(rig, assault)


@attack(links=("tcp",))
def nonsense_lines(rig):
    """Lines too long, too deep, not UTF-8, not JSON, huge numbers and ids, wrong params."""
    lines = [b"\xff\xfe\n", b"[" * 60000 + b"\n", b"\n" * 5000, b"[" + STATUS[:-1] + b"]\n",
             b'{"jsonrpc":"2.0","id":1,"method":"status","params":{"a":' + b"[" * 30000 +
             b"]" * 30000 + b"}}\n", b"x" * 70000, b'{"a":' * 20000 + b"\n", b"\0" * 1000 + b"\n",
             b'{"jsonrpc":"2.0","id":"' + b"i" * 60000 + b'","method":"status"}\n',
             b'{"jsonrpc":"2.0","id":1,"method":"measured",'
             b'"params":{"axis":"z","value_um":1e999}}\n',
             b'{"jsonrpc":"2.0","id":1,"method":"prove","params":{"axis":["z"],"value_um":{}}}\n',
             b'{"jsonrpc":"2.0","id":1,"method":"controller_state","params":{"session":1}}\n',
             b'{"jsonrpc":"2.0","id":1,"method":"\\ud800"}\n', b"1e99999\n", b'"' * 3001 + b"\n"]

    def assault(rig, until):
        while time.monotonic() < until:
            line = rig.random.choice(lines)
            with contextlib.suppress(OSError), \
                    contextlib.closing(watch.connect(rig.daemon.socket, 2.0)) as link:
                link.sendall(line)
                if line.endswith(b"\n") and rig.random.random() < 0.5:
                    link.recv(4096)
    under(rig, assault)


@attack(links=("tcp",))
def broken_requests(rig):
    """Good requests with bytes flipped, cut out and doubled."""
    def assault(rig, until):
        methods = ("status", "sensors", "subscribe", "reference", "enable", "measured", "prove",
                   "controller_state", "model", "timing", "release", "cycle_end")
        while time.monotonic() < until:
            with contextlib.suppress(OSError), \
                    contextlib.closing(watch.connect(rig.daemon.socket, 2.0)) as link:
                for _ in range(50):
                    line = bytearray(watch.request(rig.random.choice(methods), axis="z",
                                                   value_um=rig.random.uniform(-3, 3)))
                    for _ in range(rig.random.randint(1, 4)):
                        at = rig.random.randrange(len(line))
                        kind = rig.random.randrange(3)
                        if kind == 0:
                            line[at] = rig.random.randrange(256)
                        elif kind == 1:
                            del line[at:at + rig.random.randint(1, 9)]
                        else:
                            line[at:at] = line[:at][-9:] * rig.random.randint(1, 20)
                        if not line:
                            break
                    link.sendall(bytes(line) + b"\n")
                link.recv(1 << 16)
    under(rig, assault)


@attack(links=("tcp",))
def commands_by_the_hundred(rig):
    """Ten operators send `enable` and `reload` without waiting for any answer."""
    def assault(rig, until):
        links = connected(rig, 10)
        lines = 10 * (watch.request("enable") + b"\n") + watch.request("reload") + b"\n"
        while time.monotonic() < until:
            for link in links:
                sends_what_it_can(link, lines)
            time.sleep(0.1)
        closed(links)
    under(rig, assault)
