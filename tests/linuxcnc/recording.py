"""Recording by `sampler` in each servo period: displayed positions, requested offsets, drive
commands relative to the positions, and applied offsets according to HAL."""

import contextlib
import dataclasses

import numpy as np

from cnc import AXES

SERVO_PERIOD_S = 0.001



@dataclasses.dataclass
class Smooth:
    """Limits of an offset's change, from the HAL file."""
    step_um: float  # per servo period
    acceleration_mm_per_s2: float

    def holds(self, recording):
        return (recording.largest_step_um() <= self.step_um and
                recording.largest_acceleration_mm_per_s2() <= self.acceleration_mm_per_s2)


# limit3 has 0.05 mm/s and 0.5 mm/s2. LinuxCNC itself approaches an external offset with a share of
# 0.01 of the axis's 1000 mm/s2.
SMOOTH = {"joint": Smooth(0.0505, 0.55), "external": Smooth(0.06, 10.0)}

# LinuxCNC interpolates between displayed positions: the drive commands' difference equals the
# offset only after a standstill of this length.
STANDS_PERIODS = 20


@dataclasses.dataclass
class Recording:
    position_mm: np.ndarray  # (samples, axes)
    asked_um: np.ndarray
    added_um: np.ndarray  # drive command less displayed position
    applied_um: np.ndarray  # from HAL: command out of `offset` less into it, or eoffset
    enabled: np.ndarray  # (samples)
    motion_type: np.ndarray

    def standing(self):
        """Samples at which no axis has moved for STANDS_PERIODS."""
        moved = np.any(np.diff(self.position_mm, axis=0) != 0, axis=1)
        last = np.maximum.accumulate(np.where(moved, np.arange(1, len(moved) + 1), 0))
        return np.append(False, np.arange(1, len(moved) + 1) - last >= STANDS_PERIODS)

    def follow_error_um(self):
        """Largest difference between applied and requested offset at any time, and between offset
        at the drives and requested offset at standstill."""
        at_rest = np.abs(self.added_um - self.asked_um)[self.standing()]
        assert len(at_rest) > 0
        return max(float(np.max(np.abs(self.applied_um - self.asked_um))),
                   float(np.max(at_rest)))

    def largest_step_um(self):
        """Largest change of any axis's offset per servo period while the machine is on."""
        return float(np.max(np.abs(np.diff(self.applied_um, axis=0))[self.on(1)], initial=0.0))

    def largest_acceleration_mm_per_s2(self):
        bends = np.abs(np.diff(self.applied_um, n=2, axis=0))[self.on(2)]
        return float(np.max(bends, initial=0.0)) * 1e-3 / SERVO_PERIOD_S**2

    def on(self, periods):
        """Differences over this number of periods during which the machine was always on."""
        count = len(self.enabled) - periods
        return np.all([self.enabled[i:i + count] > 0 for i in range(periods + 1)], axis=0)


@contextlib.contextmanager
def recording(cnc, name="recording.txt"):
    """Records while the block runs: yields a list that contains the recording afterwards."""
    made = []
    cnc.record(name)
    yield made
    assert cnc.recorded() == 0, "the recorder was too slow"
    made.append(read_recording(cnc.folder / name))


def read_recording(path):
    lines = path.read_text().splitlines()
    # The recorder counts samples from its start, the sampler from LinuxCNC's.
    table = np.array([[float(word) for word in line.split()] for line in lines
                      if line != "overrun"])
    assert len(AXES) == 3
    return Recording(table[:, 0:3], table[:, 3:6], table[:, 6:9], table[:, 9:12], table[:, 12],
                     table[:, 13])
