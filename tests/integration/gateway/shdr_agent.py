"""Agent side of an adapter, written from MTConnect's published protocol, independent of our code. It reads the
device file and refuses lines that the file or the protocol does not allow."""

import re
import socket
import time
import xml.etree.ElementTree

from lab import PATIENCE_S

# A line has a time stamp and either key-value pairs or one condition with level, native code, native
# severity, qualifier and text; a line starting with `*` is a command.
TIME = re.compile(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d(?:\.\d{1,9})?Z")
NUMBER = re.compile(r"[+-]?\d+(?:\.\d+)?(?:[eE][+-]?\d+)?")
COMMAND = re.compile(r"\* PONG [1-9]\d*")
NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_.-]*")
LEVELS = {"NORMAL", "WARNING", "FAULT", "UNAVAILABLE"}
QUALIFIERS = {"", "HIGH", "LOW"}
# Allowed data items of the device file: units; for events the values (None: any text).
SAMPLES = {"TEMPERATURE": "CELSIUS", "DISPLACEMENT": "MILLIMETER", "ANGLE": "DEGREE"}
EVENTS = {"AVAILABILITY": {"AVAILABLE", "UNAVAILABLE"}, "VARIABLE": None,
          "FUNCTIONAL_MODE": {"PRODUCTION", "SETUP", "TEARDOWN", "MAINTENANCE", "PROCESS_DEVELOPMENT",
                              "UNAVAILABLE"}}
CONDITIONS = {"SYSTEM", "COMMUNICATIONS", "TEMPERATURE", "HARDWARE"}
NAMESPACE = re.compile(r"\{urn:mtconnect\.org:MTConnectDevices:(\d)\.(\d+)\}(\w+)")


class Refused(Exception):
    """The reason."""


def items_of(device_file):
    """{name: attributes} of each data item. Raises Refused if the file does not describe a device."""
    root = xml.etree.ElementTree.fromstring(device_file)
    found = {}
    ids = set()
    places = {}
    for element in root.iter():
        tag = NAMESPACE.fullmatch(element.tag)
        if not tag:
            raise Refused("no element of MTConnectDevices: " + element.tag)
        places.setdefault(tag.group(3), []).append(element)
        if (own := element.get("id")) is not None:
            if not NAME.fullmatch(own) or own in ids:
                raise Refused("no id, or twice: " + own)
            ids.add(own)
    if not root.tag.endswith("}MTConnectDevices") or len(places.get("Device", ())) != 1:
        raise Refused("not one device")
    device, = places["Device"]
    if not all(device.get(key) for key in ("id", "name", "uuid")) or len(places.get("Header", ())) != 1:
        raise Refused("a device has id, name and uuid, its document a header")
    for item in places.get("DataItem", ()):
        kind, category, units = item.get("type"), item.get("category"), item.get("units")
        allowed = {"SAMPLE": SAMPLES, "EVENT": EVENTS, "CONDITION": CONDITIONS}.get(category, ())
        if kind not in allowed or not NAME.fullmatch(item.get("name", "")):
            raise Refused(f"{category} {kind} {item.get('name')}")
        if units != (SAMPLES[kind] if category == "SAMPLE" else None):
            raise Refused(f"{kind} in {units}")
        found[item.get("name")] = dict(item.attrib)
    if "AVAILABILITY" not in (item["type"] for item in found.values()):
        raise Refused("a device says whether it is available")
    return found


class Agent:
    """State of an agent from an adapter's lines."""

    def __init__(self, port, device_file=None):
        self.items = items_of(device_file) if device_file else None
        self.link = socket.create_connection(("127.0.0.1", port), PATIENCE_S)
        self.rest = b""
        self.values = {}
        self.conditions = {}
        self.pongs = []
        self.lines = 0
        self.refused = []
        self.last_time = ""

    def close(self):
        self.link.close()

    def read(self):
        block = self.link.recv(65536)
        assert block, "the adapter closed"
        *lines, self.rest = (self.rest + block).split(b"\n")
        for line in lines:
            self.lines += 1
            try:
                self.take(line.decode())
            except (Refused, UnicodeDecodeError) as why:
                self.refused.append((line, str(why)))

    def take(self, line):
        if line.startswith("*"):
            if not COMMAND.fullmatch(line):
                raise Refused("no command")
            self.pongs.append(line)
            return
        if any(ord(c) < 32 or ord(c) == 127 for c in line):
            raise Refused("a control character")
        when, *fields = line.split("|")
        if not TIME.fullmatch(when) or when < self.last_time:
            raise Refused("no time, or one before the last")
        self.last_time = when
        if len(fields) == 6 and fields[1] in LEVELS and self.category(fields[0]) == "CONDITION":
            self.take_condition(*fields)
            return
        if len(fields) < 2 or len(fields) % 2:
            raise Refused("no pairs")
        pairs = list(zip(fields[::2], fields[1::2]))
        if len({key for key, _ in pairs}) != len(pairs):
            raise Refused("an item twice in a line")
        for key, value in pairs:
            self.take_value(key, value)

    def category(self, key):
        if self.items is None:
            return "CONDITION" if key.startswith(("system", "sensor_", "bus_")) else None
        if key not in self.items:
            raise Refused("not in the device file: " + key)
        return self.items[key]["category"]

    def take_condition(self, key, level, code, severity, qualifier, text):
        if qualifier not in QUALIFIERS:
            raise Refused("qualifier " + qualifier)
        active = self.conditions.setdefault(key, {})
        if level in ("NORMAL", "UNAVAILABLE"):
            if code:
                active.pop(code, None)
            else:
                active.clear()
            return
        if not code:
            raise Refused("nothing tells it from others: " + key)
        active[code] = (level, text)

    def take_value(self, key, value):
        if not NAME.fullmatch(key) or self.category(key) == "CONDITION":
            raise Refused("no item with a value: " + key)
        if self.items is not None:
            item = self.items[key]
            if item["category"] == "SAMPLE":
                if value != "UNAVAILABLE" and not NUMBER.fullmatch(value):
                    raise Refused(f"{key} is no number: {value}")
            elif (words := EVENTS[item["type"]]) is not None and value not in words:
                raise Refused(f"{item['type']} is never {value}")
            elif not value:
                raise Refused(key + " says nothing")
        self.values[key] = value

    def wait_for(self, check, what):
        end = time.monotonic() + PATIENCE_S
        while not check():
            assert time.monotonic() < end, what
            self.read()
            assert self.refused == []
