"""The axis at the controller's side: position, writes with writer and time, and the read-back,
which may be false."""

import collections
import dataclasses
import math
import threading
import time


# The same value after this time is a retry: its answer was late or lost.
SENT_AGAIN_AFTER_S = 0.15
# If the machine stalls the daemon's cycle, the link sends the value again. A repetition within this
# time of the first write keeps the first one's reference time.
RENEWED_AFTER_S = 0.1


@dataclasses.dataclass
class Write:
    """A valid value written to the axis."""
    at_s: float  # CLOCK_MONOTONIC, before it was answered
    since_s: float  # earliest time at which before_um can have been computed
    before_um: float
    value_um: float
    writer: int
    bound_um: float = 0.0
    rate_um_per_s: float = 0.0

    @property
    def step_um(self):
        return abs(self.value_um - self.before_um)


@dataclasses.dataclass
class Writer:
    """Last write of one daemon. The next value is compared with `value_um`, which was computed
    after the answer to the previous write, at `since_s`."""
    value_um: float
    since_s: float
    at_s: float
    first_at_s: float = -math.inf  # first write of `value_um`


class Axis:
    """`shown_um()` is the read-back: the position, unless `read_error` is set."""

    def __init__(self, bound_um, rate_um_per_s):
        self.lock = threading.RLock()
        self.bound_um = bound_um
        self.rate_um_per_s = rate_um_per_s
        self.position_um = 0.0
        self.obeys = True
        self.read_error = None
        self.had_read_error = False
        self.writes = []
        self.writers = {}
        self.first_reads = {}  # before the first write; writer: (time of the first read, last readings)
        self.under_way = set()  # writers with possibly one value in transit from before a restart
        self.before_shown = lambda: None

    def written(self, value_um, writer=1, at_s=None):
        now = time.monotonic() if at_s is None else at_s
        with self.lock:
            last = self.writers.get(writer)
            if last is None:
                if writer in self.under_way and writer not in self.first_reads:
                    self.under_way.discard(writer)
                    return
                read_at, readings_um = self.first_reads.get(writer, (now, [self.position_um]))
                if now < read_at:
                    return  # sent before the restart, which drops the controller's queue
                # The first write starts from one of the readings.
                stood_um = min(readings_um, key=lambda um: abs(value_um - um))
                if abs(value_um - self.position_um) < abs(value_um - stood_um):
                    stood_um = self.position_um  # a variable error: the true position is right too
                last = Writer(stood_um, read_at, read_at)
            self.under_way.discard(writer)
            self.writes.append(Write(now, last.since_s, last.value_um, value_um, writer,
                                     self.bound_um, self.rate_um_per_s))
            same = value_um == last.value_um
            first_at_s = last.first_at_s if same else now
            again = same and (now - last.at_s > SENT_AGAIN_AFTER_S or
                              now - first_at_s < RENEWED_AFTER_S)
            self.writers[writer] = Writer(value_um, last.since_s if again else last.at_s, now,
                                          first_at_s)
            if self.obeys:
                self.position_um = value_um

    def shown_um(self, writer=1):
        with self.lock:
            self.before_shown()
            now = time.monotonic()
            self.had_read_error = self.had_read_error or self.read_error is not None
            shown_um = self.position_um if self.read_error is None else self.read_error(self, now)
            if writer not in self.writers and math.isfinite(shown_um):
                self.first_reads.setdefault(writer, (now, collections.deque(maxlen=64)))[1].append(shown_um)
            return shown_um

    def shown_arrived(self, writer=1):
        """The frames of the newest reading are sent. A write that came before is in transit if that reading is the
        first: on a busy machine, time passes between reading and sending."""
        with self.lock:
            if len(self.first_reads.get(writer, (0.0, ()))[1]) == 1:
                self.first_reads[writer] = (time.monotonic(), self.first_reads[writer][1])

    def reports_position(self, position_um):
        """The controller has moved by itself, or the previous writer is gone: the next value is
        compared with the position at its next read. A writer of this value continues."""
        with self.lock:
            self.position_um = position_um
            for writer in {**self.writers, **self.first_reads}:
                last = self.writers.get(writer)
                if last is None or last.value_um != position_um:
                    self.begin_anew(writer)

    def begin_anew(self, writer=None):
        with self.lock:
            self.under_way |= self.writers.keys() if writer is None else {writer}
            for each in (self.writers, self.first_reads):
                for one in [writer] if writer is not None else list(each):
                    each.pop(one, None)

    def written_since(self, at_s):
        with self.lock:
            return [write for write in self.writes if write.at_s > at_s]


def factor(of):
    return lambda axis, _now: of * axis.position_um


def constant(of_um):
    return lambda axis, _now: axis.position_um + of_um


def drift(um_per_s):
    begun = time.monotonic()
    return lambda axis, now: axis.position_um + um_per_s * (now - begun)


def frozen(at_um):
    return lambda _axis, _now: at_um


def jumps(by_um, readings):
    """Alternately wrong and right for this number of readings."""
    count = 0

    def shown(axis, _now):
        nonlocal count
        count += 1
        return axis.position_um + (by_um if count // readings % 2 == 0 else 0.0)
    return shown


def anything(random, most_um):
    return lambda _axis, _now: random.uniform(-most_um, most_um)


def late(by_s):
    """The position of some time ago."""
    def shown(axis, now):
        older = [write.value_um for write in axis.writes[-400:] if write.at_s <= now - by_s]
        return older[-1] if older else 0.0
    return shown


def numbers(random, values):
    return lambda _axis, _now: random.choice(values)
