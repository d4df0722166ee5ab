"""Seeds of the CANopen decoder."""


def seeds():
    """A frame: a step below 0xB0, the identifier's index in the target's list, eight bytes."""
    sdo, heartbeat, emergency, pdo = 0, 1, 2, 3

    def frame(which, *data):
        return bytes([0, which]) + bytes(data).ljust(8, b"\0")

    def short(which, *data):
        return bytes([0xB4 + len(data), which]) + bytes(data)  # 0xB4 % 9 is 0

    pause = b"\xC0"
    value = frame(pdo, 0xE1, 0x00)
    errors = frame(sdo, 0x4F, 0x01, 0x10, 0x00)
    yield "plain", (b"\0" + errors + value + pause +
        frame(sdo, 0x4B, 0x40, 0x20, 0x01, 0xE1))
    yield "reboot", (b"\x10" + errors + value + short(heartbeat, 0) + pause + errors +
        short(heartbeat, 5) + value + b"\xE0\xFF" * 2 + short(heartbeat, 5))
    yield "settings", (b"\x48" + frame(sdo, 0x60, 0x10, 0x61, 0x01) +
        frame(sdo, 0x4B, 0x10, 0x61, 0x01, 20) + frame(sdo, 0x60, 0x17, 0x10) +
        frame(sdo, 0x4B, 0x17, 0x10, 0, 100) + errors + value + short(heartbeat, 5) * 20)
    yield "mapping", (b"\x80" + frame(sdo, 0x43, 0, 0x18, 1, 0x95, 1, 0, 0x40) +
        frame(sdo, 0x4F, 0, 0x1A, 0, 1) + frame(sdo, 0x43, 0, 0x1A, 1, 0x10, 1, 0x30, 0x71) +
        errors + frame(7, 0xE1))
    yield "emergency", (b"\0" + errors + value +
        frame(emergency, 0x30, 0x50, 1, 1, 1) + value + frame(emergency, 0x10, 0x42, 1) +
        frame(emergency, 0, 0, 0, 1) + value + frame(emergency))
    yield "segments", (b"\0" + errors + pause +
        frame(sdo, 0x41, 0x40, 0x20, 0x01, 9) + frame(sdo, 0, *b"CANtran") +
        frame(sdo, 0x1B, *b"sT"))
    yield "abort_and_bus", (b"\x27" + frame(sdo, 0x80, 1, 0x10, 0, 0, 0, 2, 6) +
        b"\xFC" + value + b"\xFC" + errors + value * 16)
