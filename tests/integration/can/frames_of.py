"""Random frames of a DBC file, encoded by python3-canmatrix."""

import contextlib
import dataclasses
import io
import struct
import warnings

with warnings.catch_warnings(), contextlib.redirect_stdout(io.StringIO()):
    warnings.simplefilter("ignore")  # it warns of formats that it cannot read
    import canmatrix.formats


@dataclasses.dataclass
class Encoded:
    message: str
    identifier: int
    extended: bool
    fd: bool
    data: bytes
    raw: dict  # signal -> encoded raw value
    value: dict  # signal -> physical value by canmatrix's factor and offset

    @property
    def text(self):
        """In the form of candump -L."""
        return (f"{self.identifier:0{8 if self.extended else 3}X}{'##1' if self.fd else '#'}"
                f"{self.data.hex().upper()}")


def load(path):
    with path.open("rb") as file:
        loaded = canmatrix.formats.load(file, "dbc", dbcImportEncoding="utf8")
    return next(iter(loaded.values()))


def random_raw(signal, random):
    """A value from all bit patterns, with the end values more frequent."""
    if signal.is_float:
        value = random.choice([0.0, -1.5, random.uniform(-1e3, 1e3),
                               random.uniform(-1, 1) * 10.0 ** random.randint(-30, 30)])
        return nearest_raw(signal, value)
    low, high = ((-(1 << (signal.size - 1)), (1 << (signal.size - 1)) - 1) if signal.is_signed
                 else (0, (1 << signal.size) - 1))
    return random.choice([low, high, random.randint(low, high), random.randint(low, high)])


def nearest_raw(signal, value):
    if not signal.is_float:
        return round(value)
    return value if signal.size == 64 else struct.unpack("<f", struct.pack("<f", value))[0]


def in_ranges(value, signal):
    return any(low <= value <= high for low, high in signal.mux_val_grp)


def present(frame, raw):
    """The signals present in a frame with these multiplexor values."""
    by_name = {signal.name: signal for signal in frame.signals}

    def shown(signal):
        if frame.is_complex_multiplexed:
            if not signal.muxer_for_signal:
                return True
            muxer = by_name[signal.muxer_for_signal]
            return shown(muxer) and in_ranges(raw[muxer.name], signal)
        if signal.mux_val is None or not frame.is_multiplexed:
            return True
        muxer = next(each for each in frame.signals if each.is_multiplexer)
        return raw[muxer.name] == signal.mux_val

    return [signal for signal in frame.signals if shown(signal)]


def pages_of(frame):
    """Multiplexor values used by the frame's signals."""
    pages = {0}
    for signal in frame.signals:
        pages.update(end for group in signal.mux_val_grp for end in group)
        if isinstance(signal.mux_val, int):
            pages.add(signal.mux_val)
    return sorted(pages)


def random_frame(frame, random):
    raw = {signal.name: random_raw(signal, random) for signal in frame.signals}
    for signal in frame.signals:
        if signal.is_multiplexer and random.random() < 0.9:
            fitting = [page for page in pages_of(frame) if page < (1 << signal.size)]
            raw[signal.name] = random.choice(fitting)
    shown = present(frame, raw)
    raw = {signal.name: raw[signal.name] for signal in shown}
    # canmatrix's encode() refuses nested multiplexors; the function that it calls does not.
    encode = frame.signals_to_bytes if frame.is_complex_multiplexed else frame.encode
    data = bytes(encode(raw))
    value = {signal.name: float(raw[signal.name]) * float(signal.factor) + float(signal.offset)
             if signal.is_float else
             float(signal.factor * raw[signal.name] + signal.offset) for signal in shown}
    return Encoded(frame.name, frame.arbitration_id.id, bool(frame.arbitration_id.extended),
                   frame.size > 8 or bool(frame.is_fd), data, raw, value)


def raw_bits(signal, raw):
    if signal.is_float:
        return int.from_bytes(struct.pack("<f" if signal.size == 32 else "<d", raw), "little")
    return raw & ((1 << signal.size) - 1)


def same(ours, theirs, signal, raw):
    """Equal except for the rounding of a product and a sum."""
    size = abs(float(raw) * float(signal.factor)) + abs(float(signal.offset))
    return abs(ours - theirs) <= 1e-15 * size
