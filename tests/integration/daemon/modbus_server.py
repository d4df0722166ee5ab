"""Modbus servers in plain bytes, over TCP and a pseudo-terminal: registers set by a test, and a
hook that may falsify every answer. A client in plain bytes."""

import contextlib
import os
import pty
import queue
import select
import socket
import struct
import threading
import time
import tty

READ_BITS = (1, 2)
READ_WORDS = (3, 4)
WRITE_ONE, WRITE_MANY = 6, 16
ILLEGAL_FUNCTION, ILLEGAL_ADDRESS = 1, 2
ANSWERS_AGAIN_S = 0.02


class Registers:
    """The tables of one unit. `before_read(function, address, count)` runs before a read is
    answered, `after_write()` after a write, both with the lock held; `refusal(...)` returns an
    exception code or 0."""

    def __init__(self):
        self.lock = threading.RLock()
        self.tables = {1: {}, 2: {}, 3: {}, 4: {}}
        self.before_read = lambda function, address, count: None
        self.after_write = lambda: None
        self.refusal = lambda function, address, count: 0
        self.writer = 1  # unit number of the current request

    def clear(self):
        with self.lock:
            for table in self.tables.values():
                table.clear()

    def put(self, table, address, words):
        with self.lock:
            for i, word in enumerate(words):
                self.tables[table][address + i] = word & 0xFFFF

    def words(self, table, address, count):
        with self.lock:
            return [self.tables[table].get(address + i, 0) for i in range(count)]

    def answer(self, pdu, unit=1):
        """PDU of the answer."""
        if len(pdu) < 5:
            return bytes([pdu[0] | 0x80 if pdu else 0x80, 3])
        function, address, count = struct.unpack(">BHH", pdu[:5])
        with self.lock:
            self.writer = unit
            if code := self.refusal(function, address, count):
                return bytes([function | 0x80, code])
            if function in READ_WORDS:
                self.before_read(function, address, count)
                return struct.pack(f">BB{count}H", function, 2 * count,
                                   *self.words(function, address, count))
            if function in READ_BITS:
                self.before_read(function, address, count)
                bits = sum((self.tables[function].get(address + i, 0) & 1) << i
                           for i in range(count))
                size = (count + 7) // 8
                return struct.pack(">BB", function, size) + bits.to_bytes(size, "little")
            if function == WRITE_ONE:
                self.put(3, address, [count])
                self.after_write()
                return pdu[:5]
            if function == WRITE_MANY:
                self.put(3, address, struct.unpack(f">{count}H", pdu[6:6 + 2 * count]))
                self.after_write()
                return pdu[:5]
        return bytes([function | 0x80, ILLEGAL_FUNCTION])


class Hold:
    """Element of a falsified answer: a pause, or the end of the connection."""

    def __init__(self, seconds=0.0, close=False):
        self.seconds = seconds
        self.close = close


class Sender:
    """Sends answers in order, with their pauses, while requests are still received."""

    def __init__(self, send, close):
        self.send = send
        self.close = close
        self.queue = queue.SimpleQueue()
        threading.Thread(target=self.run, daemon=True).start()

    def put(self, parts):
        self.queue.put(parts)

    def run(self):
        with contextlib.suppress(OSError):
            while (parts := self.queue.get()) is not None:
                for part in parts:
                    if not isinstance(part, Hold):
                        self.send(part)
                        continue
                    time.sleep(part.seconds)
                    if part.close:
                        self.close()


def as_it_is(_frame_of, _request, answer):
    return [answer]


class TcpSlave:
    """One unit on 127.0.0.1. `spoil(frame_of, request, answer)` returns the bytes and Holds sent
    instead of `answer`; frame_of(pdu, transaction=None) builds other frames."""

    def __init__(self, registers, name, port=0):
        self.registers = registers
        self.name = name
        self.spoil = as_it_is
        self.greet = lambda link: None
        self.port = port
        self.links = []
        self.threads = []
        self.server = None
        self.start()

    def place(self):
        return f'host = "127.0.0.1"\nport = {self.port}\n'

    def start(self):
        self.server = socket.create_server(("127.0.0.1", self.port), reuse_port=False)
        self.port = self.server.getsockname()[1]
        self.start_thread(self.accept, self.server)

    def start_thread(self, body, argument):
        self.threads.append(threading.Thread(target=body, args=(argument,), daemon=True))
        self.threads[-1].start()

    def stop(self):
        """Like a device that is switched off."""
        server, self.server = self.server, None
        if server is not None:
            with contextlib.suppress(OSError):
                server.shutdown(socket.SHUT_RDWR)
            server.close()
        self.drop_links()

    close = stop

    def drop_links(self):
        links, self.links = self.links, []
        for link in links:
            with contextlib.suppress(OSError):
                link.shutdown(socket.SHUT_RDWR)

    def accept(self, server):
        while True:
            try:
                link, _ = server.accept()
            except OSError:
                return
            link.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self.links.append(link)
            self.start_thread(self.serve, link)

    def serve(self, link):
        with link, contextlib.suppress(OSError), link.makefile("rb") as stream:
            self.greet(link)
            sender = Sender(link.sendall, lambda: link.shutdown(socket.SHUT_RDWR))
            while len(head := stream.read(7)) == 7:
                transaction, _, length, unit = struct.unpack(">HHHB", head)
                request = stream.read(max(0, length - 1))

                def frame_of(pdu, other=transaction, unit=unit):
                    return struct.pack(">HHHB", other & 0xFFFF, 0, len(pdu) + 1, unit) + pdu

                frame_of.transaction = transaction
                answer = frame_of(self.registers.answer(request, unit))
                sender.put(self.spoil(frame_of, request, answer))
            sender.put(None)


def crc16(frame):
    crc = 0xFFFF
    for byte in frame:
        crc ^= byte
        for _ in range(8):
            crc = (crc >> 1) ^ 0xA001 if crc & 1 else crc >> 1
    return struct.pack("<H", crc)


def request_length(frame):
    """Length of the RTU request at the beginning; 0: incomplete, -1: not a request."""
    if len(frame) < 2:
        return 0
    if frame[1] in (*READ_BITS, *READ_WORDS, 5, WRITE_ONE):
        return 8
    if frame[1] == WRITE_MANY:
        return 9 + frame[6] if len(frame) > 6 else 0
    return -1


class RtuSlaves:
    """Units on one serial line: {unit number: Registers}. The daemon opens .device."""

    def __init__(self, units, name):
        self.units = units
        self.name = name
        self.spoil = as_it_is
        self.mine, self.theirs = pty.openpty()
        tty.setraw(self.mine)
        tty.setraw(self.theirs)
        self.device = os.ttyname(self.theirs)
        self.ending = False
        self.silent = False
        self.sender = Sender(lambda data: os.write(self.mine, data), lambda: None)
        self.thread = threading.Thread(target=self.run, daemon=True)
        self.thread.start()

    def place(self):
        return f'device = "{self.device}"\nbaud = 115200\nparity = "none"\n'

    def stop(self):
        """Like a disconnected cable."""
        self.silent = True

    def start(self):
        self.silent = False

    def close(self):
        self.ending = True
        self.thread.join(5)
        self.sender.put(None)
        os.close(self.mine)
        os.close(self.theirs)

    def drop_links(self):
        pass

    def run(self):
        frame = b""
        while not self.ending:
            if not select.select([self.mine], [], [], ANSWERS_AGAIN_S)[0]:
                frame = b""
                continue
            frame += os.read(self.mine, 512)
            while frame:
                length = request_length(frame)
                if length < 0:
                    frame = b""
                if length <= 0 or len(frame) < length:
                    break
                request, frame = frame[:length], frame[length:]
                self.take(request)

    def take(self, request):
        body, unit = request[:-2], request[0]
        if self.silent or crc16(body) != request[-2:] or unit not in self.units:
            return

        def frame_of(pdu, _transaction=None, unit=unit):
            return bytes([unit]) + pdu + crc16(bytes([unit]) + pdu)

        frame_of.transaction = 0
        answer = frame_of(self.units[unit].answer(body[1:], unit))
        self.sender.put(self.spoil(frame_of, body[1:], answer))


# ---- client

def request(unit, pdu, transaction=1):
    return struct.pack(">HHHB", transaction, 0, len(pdu) + 1, unit) + pdu


def read_request(function, address, count):
    return struct.pack(">BHH", function, address, count)


def receive(link, count):
    data = b""
    while len(data) < count:
        piece = link.recv(count - len(data))
        if not piece:
            raise EOFError
        data += piece
    return data


def answer(link):
    """(transaction, unit, PDU) of the next answer."""
    transaction, _, length, unit = struct.unpack(">HHHB", receive(link, 7))
    return transaction, unit, receive(link, length - 1)


def ask(link, unit, pdu, transaction=1):
    link.sendall(request(unit, pdu, transaction))
    got, _, body = answer(link)
    assert got == transaction
    return body
