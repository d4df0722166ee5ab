"""A day of 64 channels, one row per minute: 56 temperatures, of which the model uses 48, six
operating signals, a position, and a displacement with heat that no sensor measures."""

import pathlib

import numpy as np

ROWS = 1440
STEP_S = 60.0
INPUTS, OTHERS, SIGNALS = 48, 8, 6


def low_pass(values, tau_s):
    share = -np.expm1(-STEP_S / tau_s)
    out = np.empty_like(values)
    state = values[0].copy()
    for i in range(len(values)):
        state = state + share * (values[i] - state)
        out[i] = state
    return out


def day(seed):
    random = np.random.default_rng(seed)
    blocks = ROWS // 30
    signals = np.repeat(random.choice([0.0, 1500.0, 3000.0, 6000.0], (blocks, SIGNALS)), 30, axis=0)
    position = np.repeat(random.uniform(0.0, 500.0, (ROWS // 10, 1)), 10, axis=0)
    room = 21.0 + np.sin(2 * np.pi * np.arange(ROWS) / 1440.0)
    temps = np.empty((ROWS, INPUTS + OTHERS))
    for i in range(temps.shape[1]):
        mix = signals @ random.uniform(0.0, 1.0, SIGNALS) / 3000.0
        temps[:, i] = room + low_pass(mix, random.uniform(1200.0, 9000.0))
    return signals, position, temps


def write(folder):
    folder = pathlib.Path(folder)
    coefficients = np.random.default_rng(1).uniform(-3.0, 3.0, INPUTS)
    signals = [f"s{i}_rpm" for i in range(SIGNALS)]
    temps = [f"t{i:02d}_degC" for i in range(INPUTS + OTHERS)]
    header = ",".join(["time_s"] + signals + ["x_mm"] + temps + ["z_um"])
    for seed, name in ((2, "train.csv"), (3, "test.csv")):
        u, x, t = day(seed)
        noise = np.random.default_rng(seed + 10)
        z = (t - t[0])[:, :INPUTS] @ coefficients
        z = z + 0.004 * low_pass(u[:, 0], 2400.0)
        z = z + noise.normal(0.0, 0.3, ROWS)
        t = t + noise.normal(0.0, 0.02, t.shape)
        table = np.column_stack([STEP_S * np.arange(ROWS), u, x, t, z])
        np.savetxt(folder / name, table, fmt="%.7g", delimiter=",", header=header, comments="")
    names = ", ".join(f'"{n}"' for n in temps[:INPUTS])
    row = ", ".join(f"{k:.6f}" for k in coefficients)
    (folder / "model.toml").write_text(f'format = 1\ninputs = [{names}]\noutputs = ["z_um"]\n'
                                       f'reference = "first_sample"\nmatrix_um_per_K = [[{row}]]\n')
