"""docs/socket_examples.txt: a daemon accepts each request, and the answer has the documented
fields. `test_socket_document.py --write` renews the examples."""

import json
import pathlib
import socket
import sys
import tempfile
import textwrap

from lab import SOURCE, Lab
from plain_devices import Machine

DOCUMENT = SOURCE / "docs" / "socket_examples.txt"
READS = ("status", "sensors", "offsets", "timing", "model", "events")


def requests():
    """(title, method, params), in an order in which all can be carried out."""
    asked = [(method, method, None) for method in READS]
    asked += [("subscribe", "subscribe", {"methods": ["offsets"], "period_s": 0.5}),
              ("measured", "measured", {"axis": "z", "value_um": 1.5}),
              ("cycle_end", "cycle_end", None),
              ("disable", "disable", None),
              ("enable", "enable", None),
              ("reference", "reference", {"force": True}),
              ("prove", "prove", {"axis": "z", "value_um": 2.0}),
              ("release, where nothing is latched", "release", {"axis": "z"}),
              ("accept, where nothing waits", "accept", {"sensor": "column"}),
              ("reload", "reload", None),
              ("a method that there is not", "restart", None)]
    return asked


def line_of(method, params):
    request = {"jsonrpc": "2.0", "id": 1, "method": method}
    if params is not None:
        request["params"] = params
    return json.dumps(request)


class Client:
    def __init__(self, daemon):
        self.link = socket.socket(socket.AF_UNIX)
        self.link.settimeout(30)
        self.link.connect(str(daemon.socket))
        self.lines = self.link.makefile("r")

    def send(self, line):
        self.link.sendall(line.encode() + b"\n")
        return json.loads(self.lines.readline())

    def close(self):
        self.lines.close()
        self.link.close()


def exchange(daemon, line):
    """The answer; for a subscription also the first notification."""
    client = Client(daemon)
    try:
        answers = [client.send(line)]
        if json.loads(line)["method"] == "subscribe":
            answers.append(json.loads(client.lines.readline()))
        return answers
    finally:
        client.close()


def examples(text):
    """[(request line, [answer lines])] of the document."""
    found = []
    for line in text.splitlines():
        if line.startswith("> "):
            found.append((line[2:], []))
        elif line.startswith("< "):
            found[-1][1].append(line[2:])
        elif line.startswith("  ") and found:
            found[-1][1][-1] += line[1:]  # an answer of several lines
    return found


def fields(value):
    """Nested field names; of lists the first element."""
    if isinstance(value, dict):
        return {key: fields(each) for key, each in value.items()}
    if isinstance(value, list):
        return [fields(each) for each in value[:1]]
    return None


def differences(expected, answer, place="answer"):
    """Paths at which the fields of an answer differ from the document."""
    if isinstance(expected, dict) and isinstance(answer, dict):
        if "..." in expected:
            return []
        odd = [f"{place}.{key}" for key in sorted(set(expected) ^ set(answer))]
        return odd + [each for key in set(expected) & set(answer)
                      for each in differences(expected[key], answer[key], f"{place}.{key}")]
    if isinstance(expected, list) and isinstance(answer, list) and expected and answer:
        return differences(expected[0], answer[0], place + "[0]")
    return []


def pruned(value, seen):
    if isinstance(value, dict):
        return {key: pruned(each, seen) for key, each in value.items()}
    if isinstance(value, list):
        return [once(pruned(each, seen), seen) for each in value[:1]]
    return value


def once(element, seen):
    """The name only, if an earlier element had the same fields."""
    if not isinstance(element, dict):
        return element
    if tuple(element) in seen:
        return {"name": element["name"], "...": "as above"}
    seen.add(tuple(element))
    return element


def shown(answer, folder, seen):
    text = json.dumps(pruned(answer, seen)).replace(str(folder) + "/", "/etc/thermocomp/")
    return "\n  ".join(textwrap.wrap(text, 100, break_long_words=False, break_on_hyphens=False))


def running(lab):
    machine = Machine(lab)
    daemon = machine.start()
    machine.warm_by(3.0)
    daemon.wait_for_offset(3.0)
    return daemon


def test_documented_requests_are_taken(lab):
    documented = examples(DOCUMENT.read_text())
    assert [json.loads(request)["method"] for request, _ in documented] == [
        method for _, method, _ in requests()]
    daemon = running(lab)
    for request, expected in documented:
        answers = exchange(daemon, request)
        assert len(answers) == len(expected), request
        for answer, text in zip(answers, expected):
            assert not differences(fields(json.loads(text)), fields(answer)), (request, answer)


def write():
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        lab = Lab(folder)
        try:
            daemon = running(lab)
            text, seen = "", set()
            for title, method, params in requests():
                line = line_of(method, params)
                text += f"{title}:\n> {line}\n"
                for answer in exchange(daemon, line):
                    text += f"< {shown(answer, folder, seen)}\n"
                text += "\n"
        finally:
            lab.end()
    DOCUMENT.write_text(text.rstrip() + "\n")

if __name__ == "__main__":
    if sys.argv[1:] != ["--write"]:
        sys.exit("test_socket_document.py --write")
    write()
