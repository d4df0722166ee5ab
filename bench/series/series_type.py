"""Machines of one type for the benchmark of series: the plant of tests/diagnosis, with sensors."""

import pathlib
import sys

import numpy as np

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "tests" / "diagnosis"))

# ruff: noqa: E402
import plant

HOUR_S = 3600.0
EVERY = 6  # one row per minute
SENSOR_NOISE_K = 0.03
PROBE_NOISE_UM = 0.5


class TypeMachine:
    """One machine of the type: the same plant, whose details scatter by 16 %."""

    def __init__(self, seed):
        self.machine = plant.Machine(np.random.default_rng([7, seed]))
        self.seed = seed
        self.offset_K = {name: np.random.default_rng([8, seed, i]).normal(0.0, 0.3)
                         for i, name in enumerate(plant.PLACES)}

    def day(self, day, hours, change=None):
        """Columns of a new run; `change(columns, fields)` plants an effect."""
        random = np.random.default_rng([9, self.seed, day])
        steps = int(hours * HOUR_S / plant.STEP_S)
        signals = plant.duty(random, steps)
        room = plant.room_air(random, steps, wander=False)
        fields = self.machine.run(signals, room)
        rows = slice(0, steps, EVERY)
        count = len(range(steps)[rows])
        columns = {"time_s": np.arange(steps)[rows] * plant.STEP_S}
        for name, (body, cell) in plant.PLACES.items():
            values = fields[rows, self.machine.cells(body)[cell]]
            columns[name] = values + self.offset_K[name] + random.normal(0, SENSOR_NOISE_K, count)
        for name in ("spindle_rpm", "feed_mm_per_min", "coolant_on"):
            columns[name] = signals[name][rows]
        for output in plant.OUTPUTS:
            moved = self.machine.displacement(fields, output)[rows]
            columns[output] = moved + random.normal(0, PROBE_NOISE_UM, count)
        if change:
            change(columns, fields[rows])
        return columns
