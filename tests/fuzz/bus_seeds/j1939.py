"""Seeds of the J1939 decoder."""
import struct


def seeds():
    name = struct.pack("<Q", 0x8000FF0012345678)

    def frame(which, data):
        return bytes([0, which]) + bytes(data).ljust(8, b"\0")

    group, announce, packet, request, addressed, claim = 0, 1, 2, 3, 4, 5
    yield "group", (b"\0" + frame(group, [63, 0, 0x25, 1, 0xFE, 0xFF]) +
        frame(group, [7, 0xFF] + [0xFE] * 6))
    message = bytes(range(32))
    packets = [bytes([i + 1]) + message[7 * i:7 * i + 7].ljust(7, b"\xff") for i in range(5)]
    bam = bytes([32, 32, 0, 5, 0xFF, 0x10, 0xFF, 0])
    yield "broadcast", (b"\0" + frame(announce, bam) +
        b"".join(frame(packet, each) for each in packets))
    yield "transport", (b"\2" + bam + b"".join(packets))
    yield "to_us", (b"\1" + frame(request, [16, 32, 0, 5, 2, 0, 0xEF, 0]) +
        b"".join(frame(addressed, each) for each in packets))
    yield "overdue", (b"\1" + frame(request, [16, 32, 0, 5, 2, 0, 0xEF, 0]) +
        frame(addressed, packets[0]) + b"\xE0\xFF" + frame(announce, bam) + b"\xE0\xFF")
    yield "claims", (b"\1" + frame(claim, name) + frame(9, name) +
        frame(7, name) + frame(6, [0, 0xEE, 0]) + b"\xFC\xFC" + frame(claim, name))
