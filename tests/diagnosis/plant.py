"""A machine of five bodies as temperature fields: finite volumes, conduction, joints, convection.

Independent of the forms that the diagnosis looks for. Displacement is the integral of the expansion
over the fields, with levers for bending; sensors read the field at places.
"""

import numpy as np

BODIES = ("bed", "column", "head", "screw", "table")
CELLS = 10
STEP_S = 10.0
ALPHA_UM_PER_M_K = 11.5
# m: length; s: time constant to the room; s: time of conduction along the whole body.
LENGTH_M = {"bed": 1.2, "column": 1.0, "head": 0.5, "screw": 0.8, "table": 0.6}
ROOM_S = {"bed": 21000.0, "column": 12000.0, "head": 5000.0, "screw": 3500.0, "table": 8000.0}
ALONG_S = {"bed": 26000.0, "column": 16000.0, "head": 4500.0, "screw": 9000.0, "table": 7000.0}
JOINTS = (("bed", 9, "column", 0, 4000.0), ("column", 9, "head", 0, 2500.0),
          ("bed", 2, "screw", 0, 6000.0), ("screw", 9, "table", 4, 7000.0))
OUTPUTS = ("z_um", "y_um")
# Levers of each body's expansion on the outputs [1].
LEVERS = {"z_um": {"column": 1.0, "head": -1.3, "bed": 0.2, "screw": 0.1, "table": 0.5},
          "y_um": {"column": 0.3, "head": 0.9, "bed": -0.8, "screw": 1.1, "table": -0.3}}
# Bending of a body warmer at one end: um per K of the field's first moment.
BENDING = {"z_um": {"column": 3.0, "bed": -2.0}, "y_um": {"column": 1.0, "head": 2.0}}


class Machine:
    """One machine: random details from `random`, the same for all its runs."""

    def __init__(self, random):
        self.random = random
        vary = lambda low=0.75, high=1.3: random.uniform(low, high)
        size = len(BODIES) * CELLS
        self.rate = np.zeros((size, size))
        self.to_room = np.zeros(size)
        for body in BODIES:
            cells = self.cells(body)
            conduction = CELLS ** 2 / (ALONG_S[body] * vary())
            for a, b in zip(cells[:-1], cells[1:]):
                self._exchange(a, b, conduction, conduction)
            self.to_room[cells] = 1.0 / (ROOM_S[body] * vary())
        for first, i, second, j, time_s in JOINTS:
            rate = CELLS / (time_s * vary())
            self._exchange(self.cells(first)[i], self.cells(second)[j], rate / LENGTH_M[first],
                           rate / LENGTH_M[second])
        self.spindle_K_per_s = 0.03 * vary()  # of the hottest cell at full speed
        self.feed_K_per_s = 0.014 * vary()
        self.pump_K_per_s = 0.004 * vary()
        self.spindle_power = random.uniform(1.0, 1.6)
        self.bending = {o: {b: v * vary() for b, v in BENDING[o].items()} for o in OUTPUTS}
        self.levers = {o: {b: v * vary() for b, v in LEVERS[o].items()} for o in OUTPUTS}
        step = np.eye(size) + STEP_S * (self.rate - np.diag(self.to_room))
        self.step = step

    def _exchange(self, a, b, rate_a, rate_b):
        self.rate[a, a] -= rate_a
        self.rate[a, b] += rate_a
        self.rate[b, b] -= rate_b
        self.rate[b, a] += rate_b

    @staticmethod
    def cells(body):
        start = BODIES.index(body) * CELLS
        return np.arange(start, start + CELLS)

    def run(self, signals, room_degC):
        """Fields [degC], shape (steps, cells), from the signals at every step; from equilibrium."""
        rpm = signals["spindle_rpm"] / 6000.0
        source = np.zeros((len(rpm), len(self.to_room)))
        head, screw, bed = self.cells("head"), self.cells("screw"), self.cells("bed")
        for place, weight in ((7, 1.0), (8, 0.8), (5, 0.4)):
            source[:, head[place]] += weight * self.spindle_K_per_s * rpm ** self.spindle_power
        feed = signals["feed_mm_per_min"] / 12000.0
        source[:, screw[3:8]] += (self.feed_K_per_s * feed)[:, None] / 3.0
        source[:, bed[4:6]] += (self.pump_K_per_s * signals["coolant_on"])[:, None]
        drive = STEP_S * (source + room_degC[:, None] * self.to_room)
        fields = np.empty_like(source)
        field = np.full(len(self.to_room), room_degC[0])
        for i in range(len(rpm)):
            fields[i] = field
            field = self.step @ field + drive[i]
        return fields

    def displacement(self, fields, output):
        """Expansion integrated over the fields [um], relative to 20 degC."""
        total = np.zeros(len(fields))
        moment = np.linspace(-1.0, 1.0, CELLS)
        for body in BODIES:
            rise = fields[:, self.cells(body)] - 20.0
            lever = self.levers[output].get(body, 0.0)
            total += lever * ALPHA_UM_PER_M_K * LENGTH_M[body] * rise.mean(axis=1)
            total += self.bending[output].get(body, 0.0) * (rise @ moment) / CELLS
        return total


PLACES = {"bed_front_degC": ("bed", 2), "bed_rear_degC": ("bed", 7), "column_low_degC": ("column", 1),
          "column_mid_degC": ("column", 5), "column_top_degC": ("column", 8),
          "head_degC": ("head", 3), "spindle_degC": ("head", 7), "screw_degC": ("screw", 5),
          "nut_degC": ("screw", 8), "table_degC": ("table", 5)}


def room_air(random, steps, wander):
    time_h = np.arange(steps) * STEP_S / 3600.0
    swing = random.uniform(0.5, 1.0) if not wander else random.uniform(1.2, 2.5)
    room = 21.0 + swing * np.sin(2 * np.pi * (time_h / 24.0 + random.uniform()))
    walk = np.cumsum(random.normal(0.0, 1.0, steps)) * np.sqrt(STEP_S / 3600.0)
    walk -= np.linspace(walk[0], walk[-1], steps)
    return room + (0.2 if wander else 0.05) * walk


def duty(random, steps):
    """Operating signals at every step: periods of work with stops, positions of a moving axis."""
    def stretches(values, low_s, high_s, rest):
        out = np.zeros(steps)
        at = int(random.uniform(600, 2400) / STEP_S)
        while at < steps:
            end = at + int(random.uniform(low_s, high_s) / STEP_S)
            out[at:end] = 0.0 if random.uniform() < rest else random.choice(values)
            at = end
        return out
    rpm = stretches([1500, 3000, 4500, 6000], 1200, 7200, 0.3)
    feed = stretches([3000, 6000, 12000], 900, 5400, 0.35)
    coolant = stretches([1.0], 1800, 9000, 0.4)
    x = np.interp(np.arange(steps), np.arange(0, steps + 60, 60),
                  random.uniform(0.0, 500.0, (steps + 60) // 60 + 1)[:len(np.arange(0, steps + 60, 60))])
    return {"spindle_rpm": rpm, "feed_mm_per_min": feed, "coolant_on": coolant, "x_mm": x}
