"""Attacks on the gateway: nothing changes, the daemon is not affected, the next page is served."""

import base64
import contextlib
import http.client
import json
import signal
import socket
import threading
import time

import pytest

from gateway_lab import Gateway, guarded_gateway
from lab import eventually, run_tool


@pytest.fixture(autouse=True)
def nothing_changed(machine):
    # The first reference is reported after its step has been saved.
    eventually(lambda: machine.daemon.status()["reference"]["by"], "the reference is taken")
    before = machine.daemon.status()
    yield
    after = machine.daemon.status()
    for status in (before, after):
        del status["reference"]["objections"]  # depend on the temperatures of the test
    for key in ("enabled", "mode", "reference", "model"):
        assert after[key] == before[key], key


def serves(gateway):
    """Waits for page and status; the first request to the daemon may still be pending."""
    eventually(lambda: gateway.ask("/")[0] == 200 and gateway.ask("/api/status")[0] == 200,
               "the gateway serves")
    return True


def status_of(answer):
    return int(answer.split(b" ", 2)[1]) if answer.startswith(b"HTTP/1.1 ") else None


def get(path, host=b"localhost", more=b""):
    return (b"GET " + path + b" HTTP/1.1\r\nHost: " + host + b"\r\nConnection: close\r\n" + more +
            b"\r\n")


def test_paths_that_climb_find_nothing(gateway):
    for path in (b"/../../etc/passwd", b"/%2e%2e/%2e%2e/etc/passwd", b"/page.js/../../gateway.toml",
                 b"//etc/passwd", b"/page.js%00.html", b"/dygraph.js.map", b"/.git/config",
                 b"/api", b"/api/", b"/index.html", b"/\xff\xfe"):
        answer = gateway.raw(get(path))
        assert b"root:" not in answer and b"machine =" not in answer
        assert status_of(answer) in (400, 404) or answer == b"" or (
            path == b"/page.js%00.html"), (path, answer[:200])
    assert gateway.raw(get(b"file:///etc/passwd")).find(b"root:") < 0
    assert serves(gateway)


def test_headers_cannot_be_injected(gateway):
    answer = gateway.raw(get(b"/x%0d%0aSet-Cookie:%20a=b"))
    assert b"Set-Cookie" not in answer
    answer = gateway.raw(get(b"/api/history?from=%0d%0aSet-Cookie:a"))
    head = answer.split(b"\r\n\r\n")[0]
    assert status_of(answer) == 400 and b"Set-Cookie" not in head
    assert serves(gateway)


def test_oversize_is_refused(gateway):
    for request in (get(b"/" + b"a" * 100000), get(b"/", more=b"X: " + b"b" * 200000 + b"\r\n"),
                    get(b"/?" + b"&".join(b"k%d=v" % i for i in range(3000))),
                    get(b"/", more=b"".join(b"H%d: v\r\n" % i for i in range(20000)))):
        assert status_of(gateway.raw(request)) not in (200,), request[:40]
    body = b"x" * 1000000
    answer = gateway.raw(b"POST /api/command HTTP/1.1\r\nHost: localhost\r\n"
                         b"Content-Type: application/json\r\n"
                         b"Content-Length: 1000000\r\n\r\n" + body)
    assert status_of(answer) in (413, None)
    assert serves(gateway)


def test_other_protocols_than_http_are_refused(gateway):
    for junk in (b"\x16\x03\x01\x02\x00\x01" + bytes(200), b"\r\n" * 1000, b"GET\r\n\r\n",
                 b"GET / HTTP/9.9\r\n\r\n", b"DELETE / HTTP/1.1\r\nHost: localhost\r\n\r\n",
                 b"GET / HTTP/1.1\r\nHost: localhost\r\nHost: evil\r\n\r\n",
                 b"POST / HTTP/1.1\r\nHost: localhost\r\nContent-Length: -5\r\n\r\n",
                 b"POST / HTTP/1.1\r\nHost: localhost\r\nTransfer-Encoding: chunked\r\n\r\nzz\r\n"):
        assert status_of(gateway.raw(junk)) != 200, junk[:40]
    assert serves(gateway)


def test_other_sites_get_nothing(gateway):
    for host in ("evil.example", "localhost.evil.example", "mill_3", "127.0.0.2", "",
                 "localhost:12345678", "a" * 300, "[::1", "localhost:80:80"):
        answer = gateway.raw(get(b"/api/status", host=host.encode()))
        assert status_of(answer) in (400, 421), (host, answer[:100])
    for headers in ({"Origin": "http://evil.example"}, {"Origin": "null"},
                    {"Sec-Fetch-Site": "cross-site"}, {"Sec-Fetch-Site": "same-site"},
                    {"Origin": f"http://localhost:{gateway.port + 1}"}):
        for method, path in (("GET", "/api/status"), ("GET", "/api/events"),
                             ("POST", "/api/command")):
            status, _, _ = gateway.ask(path, method=method, headers=headers, body=(
                b"{}" if method == "POST" else None))
            assert status == 403, (headers, path)
    # Requests of the page itself, and through a tunnel with another port.
    assert gateway.ask("/api/status", headers={"Origin": f"http://127.0.0.1:{gateway.port}",
                                               "Sec-Fetch-Site": "same-origin"})[0] == 200
    assert status_of(gateway.raw(get(b"/api/status", host=b"localhost:9999"))) == 200
    _, headers, _ = gateway.ask("/")
    assert "default-src 'none'" in headers["Content-Security-Policy"]
    assert "Access-Control-Allow-Origin" not in headers


def test_commands_that_are_not_configured_are_refused(machine, gateway):
    for body in (b'{"method": "disable"}', b'{"token": "0"}', b"{", b"[]", b'{"method": 5}'):
        status, _, answer = gateway.ask("/api/command", method="POST", body=body,
                                        headers={"Content-Type": "application/json"})
        assert status in (400, 403, 410), answer
    status, _, _ = gateway.ask("/api/command", method="POST", body=b"method=disable", headers={
        "Content-Type": "application/x-www-form-urlencoded"})
    assert status == 415
    assert gateway.json("/api/commands")["commands"] == []
    assert machine.daemon.status()["enabled"]


def test_three_hundred_connections_do_not_keep_it_from_others(machine, gateway):
    links = []
    with contextlib.ExitStack() as stack:
        for i in range(300):
            with contextlib.suppress(OSError):
                link = stack.enter_context(
                    socket.create_connection(("127.0.0.1", gateway.port), 5))
                link.sendall(b"GET / HTTP/1.1\r\nHo" if i % 2 else b"")
                links.append(link)
        assert len(links) > 100
        # Idle connections are closed, which frees places.
        eventually(lambda: asks_in_vain_at_most(gateway), "a place is free again", 60)
    eventually(lambda: serves(gateway), "it serves again")
    assert machine.daemon.status()["mode"] == "compensating"


def asks_in_vain_at_most(gateway):
    with contextlib.suppress(OSError, http.client.HTTPException):
        with contextlib.closing(gateway.connect(3)) as link:
            link.request("GET", "/api/status")
            return link.getresponse().status == 200


def test_a_page_that_does_not_read_is_closed_and_uses_no_memory(gateway):
    def resident_kB():
        with open(f"/proc/{gateway.process.pid}/status") as text:
            return int(next(line.split()[1] for line in text if line.startswith("VmRSS")))

    gateway.wait_for(lambda s: s["here"], "a state")
    before = resident_kB()
    with contextlib.ExitStack() as stack:
        for _ in range(40):
            link = stack.enter_context(socket.create_connection(("127.0.0.1", gateway.port), 5))
            link.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1024)
            link.sendall(get(b"/api/events"))
        with gateway.events() as next_state:
            for _ in range(6):
                next_state()
        assert resident_kB() < before + 8000
    assert serves(gateway)


@pytest.fixture
def guarded(lab, machine):
    return guarded_gateway(lab, machine.daemon, {"maria": "long and secret", "guest": "only looks on"},
                           'users = ["maria"]\nmethods = ["enable", "disable", "prove", "accept"]')


def as_user(name, password):
    return {"Authorization": "Basic " + base64.b64encode(f"{name}:{password}".encode()).decode()}


MARIA = as_user("maria", "long and secret")


def test_without_the_password_there_is_nothing(guarded):
    for headers in ({}, as_user("maria", "wrong"), as_user("nobody", "long and secret"),
                    {"Authorization": "Basic !!!"}, {"Authorization": "Bearer x"}):
        for path in ("/", "/metrics", "/api/status", "/api/events", "/api/commands"):
            assert guarded.ask(path, headers=headers)[0] in (401, 429), (headers, path)
    assert guarded.ask("/api/status", headers=MARIA)[0] in (200, 429)
    eventually(lambda: guarded.ask("/api/status", headers=MARIA)[0] == 200, "maria gets in")


def test_wrong_passwords_do_not_lock_out_logged_in_users(guarded):
    assert guarded.ask("/api/status", headers=MARIA)[0] == 200
    began = time.monotonic()
    answers = [guarded.ask("/", headers=as_user("maria", f"guess {i}"))[0] for i in range(60)]
    looked_at_max = 8 + 4 * (time.monotonic() - began)  # a burst, then four a second
    assert set(answers) <= {401, 429} and answers.count(401) <= looked_at_max + 1
    assert guarded.ask("/api/status", headers=MARIA)[0] == 200


def post(gateway, body, headers):
    status, _, answer = gateway.ask("/api/command", method="POST", body=json.dumps(body),
                                    headers={"Content-Type": "application/json", **headers})
    return status, json.loads(answer)


def test_unconfirmed_commands_of_one_user_do_not_block_another(lab, machine):
    gateway = guarded_gateway(lab, machine.daemon, {"maria": "long and secret", "otto": "asks and asks"},
                              'users = ["maria", "otto"]\nmethods = ["disable"]')
    otto = as_user("otto", "asks and asks")
    eventually(lambda: post(gateway, {"method": "disable"}, MARIA)[0] == 200, "the daemon is here")
    asked = [post(gateway, {"method": "disable"}, otto) for _ in range(100)]
    assert {status for status, _ in asked} == {200}
    assert post(gateway, {"method": "disable"}, MARIA)[0] == 200
    assert post(gateway, {"token": asked[0][1]["token"]}, otto)[0] == 410  # no longer
    assert machine.daemon.status()["enabled"]


INNER = b"GET /api/status HTTP/1.1\r\nHost: localhost\r\n\r\n"
ONE_LENGTH = b"Content-Length: %d\r\n" % len(INNER)
CHUNKED = b"Transfer-Encoding: chunked\r\n"


BODIES_OF_TWO_LENGTHS = (b"Content-Length: 0\r\n" + ONE_LENGTH + b"\r\n",
                         ONE_LENGTH + b"Content-Length: 0\r\n\r\n",
                         ONE_LENGTH + CHUNKED + b"\r\n0\r\n\r\n")


def test_the_rest_of_a_refused_request_is_no_request(gateway):
    for start in (b"GET /api/status HTTP/1.1\r\nHost: evil.example\r\n",
                  b"GET / HTTP/1.1\r\nHost: localhost\r\nOrigin: http://evil.example\r\n",
                  b"GET /nothing HTTP/1.1\r\nHost: localhost\r\n",
                  b"POST /api/command HTTP/1.1\r\nHost: localhost\r\nOrigin: http://evil.example\r\n",
                  b"POST /api/command HTTP/1.1\r\nHost: localhost\r\n",
                  b"POST / HTTP/1.1\r\nHost: localhost\r\n",
                  b"PUT / HTTP/1.1\r\nHost: localhost\r\n",
                  b"GET /" + b"a" * 300 + b" HTTP/1.1\r\nHost: localhost\r\n"):
        for body in (b"\r\n", ONE_LENGTH + b"\r\n", CHUNKED + b"\r\n0\r\n\r\n",
                     *BODIES_OF_TWO_LENGTHS):
            answer = gateway.raw(start + body + INNER)
            assert answer.count(b"HTTP/1.1 ") == 1, (start, body, answer[:2000])
            assert status_of(answer) >= 400, (start, body, answer[:2000])


def test_a_body_of_two_lengths_is_refused(gateway):
    for body in BODIES_OF_TWO_LENGTHS:
        answer = gateway.raw(b"GET /metrics HTTP/1.1\r\nHost: localhost\r\n" + body + INNER)
        assert answer.count(b"HTTP/1.1 ") == 1 and status_of(answer) == 400, answer[:2000]


def test_bytes_after_an_oversized_body_are_no_request(gateway):
    answer = gateway.raw(b"POST /api/command HTTP/1.1\r\nHost: localhost\r\nContent-Length: 5000\r\n"
                         b"Content-Type: application/json\r\n\r\n" + b"x" * 5000 + INNER)
    assert answer.count(b"HTTP/1.1 ") == 1 and status_of(answer) == 413, answer[:2000]


def test_a_stranger_gets_one_answer_a_connection(guarded):
    """Behind a proxy the next request in the connection may be another client's."""
    inner = b"GET /api/status HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n"
    for first in (b"GET / HTTP/1.1\r\nHost: localhost\r\n\r\n",
                  b"POST /api/command HTTP/1.1\r\nHost: localhost\r\nContent-Length: %d\r\n\r\n" %
                  len(inner)):
        with socket.create_connection(("127.0.0.1", guarded.port), 10) as link, \
                guarded.context.wrap_socket(link, server_hostname="localhost") as secure:
            secure.sendall(first + inner)
            answer = b""
            with contextlib.suppress(OSError):
                while block := secure.recv(65536):
                    answer += block
        assert answer.count(b"HTTP/1.1 ") == 1 and status_of(answer) == 401, answer[:500]


def fill_queue(path):
    """Connects until the listener's queue is full."""
    links = []
    for _ in range(2000):
        link = socket.socket(socket.AF_UNIX)
        link.setblocking(False)
        try:
            link.connect(str(path))
        except BlockingIOError:
            link.close()
            return links
        links.append(link)
    raise AssertionError("the queue is never full")


def test_it_ends_while_the_daemon_hangs(machine, gateway):
    serves(gateway)
    machine.daemon.process.send_signal(signal.SIGSTOP)
    try:
        links = fill_queue(machine.daemon.socket)
        eventually(lambda: gateway.ask("/api/status")[0] == 503, "the daemon is away")
        time.sleep(3.0)  # it retries to connect
        began = time.monotonic()
        gateway.end()
        assert time.monotonic() - began < 6.0
        began = time.monotonic()
        status, out, err = machine.daemon.cli("status")
        assert status == 2 and "no answer in time" in err and time.monotonic() - began < 12.0
        for link in links:
            link.close()
    finally:
        machine.daemon.process.send_signal(signal.SIGCONT)

    def goes_on():
        with contextlib.suppress(OSError):  # it first empties its queue
            return machine.daemon.status()["mode"] == "compensating"

    eventually(goes_on, "it goes on")
    gateway.start()


def test_a_deep_answer_ends_neither_gateway_nor_command(lab, machine):
    path = lab.folder / "deep.sock"
    with socket.socket(socket.AF_UNIX) as listener:
        listener.bind(str(path))
        listener.listen(50)

        def serve(link):
            with link, link.makefile("rb") as lines, contextlib.suppress(OSError):
                for line in lines:
                    link.sendall(b'{"id":%d,"result":' % json.loads(line)["id"] + b"[" * 400000 +
                                 b"]" * 400000 + b"}\n")

        def accept():
            with contextlib.suppress(OSError):
                while True:
                    threading.Thread(target=serve, args=(listener.accept()[0],), daemon=True).start()

        threading.Thread(target=accept, daemon=True).start()
        gateway = Gateway(lab, machine.daemon)
        gateway.config.write_text(gateway.config.read_text().replace(str(machine.daemon.socket),
                                                                     str(path)))
        lab.also_end(gateway).start()
        eventually(lambda: "at most 16 deep" in gateway.log.read_text(), "it is refused in words")
        assert gateway.ask("/api/status")[0] == 503
        status, _, err = run_tool("--socket", path, "status")
        assert status == 2 and "at most 16 deep" in err
        listener.shutdown(socket.SHUT_RDWR)


def test_a_named_user_confirms_a_move(guarded, machine):
    offered = guarded.json("/api/commands", headers=MARIA)
    assert offered["commands"] == ["enable", "disable", "prove", "accept"]
    machine.warm_by(12.0)
    machine.daemon.wait_for_offset(12.0)
    eventually(lambda: abs(guarded.json("/api/status", headers=MARIA)["axes"][0]["offset"] - 12.0) <
               0.1, "the gateway knows")
    status, asked = post(guarded, {"method": "disable"}, MARIA)
    assert status == 200 and "z from +12.0 um to 0 um" in asked["text"]
    assert machine.daemon.status()["enabled"]  # not before confirmation
    guest = as_user("guest", "only looks on")
    eventually(lambda: post(guarded, {"method": "disable"}, guest)[0] == 403, "not for the guest")
    assert post(guarded, {"token": asked["token"]}, guest)[0] == 410
    assert post(guarded, {"token": asked["token"]}, MARIA) == (200, {"done": True})
    machine.daemon.wait_for_mode("disabled")
    assert post(guarded, {"token": asked["token"]}, MARIA)[0] == 410  # only once
    assert post(guarded, {"method": "reference"}, MARIA)[0] == 403  # not configured
    status, asked = post(guarded, {"method": "prove", "axis": "z", "value_um": 900}, MARIA)
    assert status == 200
    status, refused = post(guarded, {"token": asked["token"]}, MARIA)
    assert status == 409 and "prove_um_max" in refused["error"]
    assert post(guarded, {"method": "prove", "axis": "q", "value_um": 1}, MARIA)[0] == 400
    for sensor in ("spindle", "none_such"):
        status, refused = post(guarded, {"method": "accept", "sensor": sensor}, MARIA)
        assert status == 400 and f"no sensor {sensor} with an unconfirmed reading" in refused["error"]
    event = next(each for each in machine.daemon.call("events")["events"] if each["code"] == "disable")
    assert event["for"] == "maria"
    status, asked = post(guarded, {"method": "enable"}, MARIA)
    assert post(guarded, {"token": asked["token"]}, MARIA) == (200, {"done": True})
    machine.daemon.wait_for_mode("compensating")


def test_tls_is_needed_where_it_is_configured(guarded):
    answer = guarded.raw(get(b"/"))
    assert b"200" not in answer[:20] and b"<html" not in answer
