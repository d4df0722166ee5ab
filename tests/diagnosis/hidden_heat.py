"""Measured temperatures of a machine that differs from its thermal network, by seed.

The machine has six bodies of five cells each, integrated in steps of seconds; the network has one
lump per body, fitted to runs of the untouched machine. Then one property of the machine is changed,
and the files are written: machine.toml, train_a.csv, train_b.csv, test.csv, truth.json.
"""

import json
import pathlib

import numpy as np

import plant

BODIES = ("bed", "column", "head", "motor", "screw", "table")
CELLS = 5
STEP_S = 10.0
CAPACITY = {"bed": 90e3, "column": 60e3, "head": 25e3, "motor": 12e3, "screw": 9e3, "table": 30e3}
ROOM = {"bed": 14.0, "column": 9.0, "head": 6.0, "motor": 5.0, "screw": 2.5, "table": 6.0}
ALONG = {"bed": 120.0, "column": 90.0, "head": 120.0, "motor": 150.0, "screw": 60.0, "table": 90.0}
# W/K between the cell of one body and that of another.
JOINTS = {("bed", "column"): (4, 0, 15.0), ("column", "head"): (4, 0, 18.0),
          ("head", "motor"): (4, 0, 10.0), ("bed", "screw"): (1, 0, 6.0),
          ("screw", "table"): (4, 2, 5.0)}
COOLANT = {"head": 8.0}
# (signal, body): W at the signal's largest value, exponent, cells
SOURCES = {("spindle_rpm", "head"): (170.0, 1.5, (2, 3)),
           ("spindle_rpm", "motor"): (110.0, 1.0, (1, 2, 3)),
           ("feed_mm_per_min", "screw"): (60.0, 1.0, (1, 2, 3)),
           ("coolant_on", "bed"): (90.0, 1.0, (3,))}
LARGEST = {"spindle_rpm": 6000.0, "feed_mm_per_min": 12000.0, "coolant_on": 1.0}
RUNS = (("train_a.csv", 13.0), ("train_b.csv", 9.0), ("test.csv", 9.0))
LEVELS = {1: dict(noise_K=0.01, step_K=0.0, wander=False, wrong=0.0),
          2: dict(noise_K=0.05, step_K=0.1, wander=True, wrong=0.0),
          3: dict(noise_K=0.05, step_K=0.1, wander=True, wrong=0.03)}
CAUSES = ("wrong_film_coefficient", "wrong_heat_source", "missing_heat_source", "wrong_conductance",
          "wrong_heat_capacity", "wrong_ambient")
FAULTS = ("sensor_step", "sensor_drift", "slow_sensor")
OUTSIDE = ("outside_bursts", "outside_walk")
EFFECT_K = 0.4   # least RMS of an effect at the most affected sensor, centred per run ...
EXCEEDS = 1.5    # ... and relative to the network's remainder there on the untouched machine


class Body:
    """Thermal properties of the machine, changed by name and integrated as a field."""

    def __init__(self, random):
        vary = lambda: random.uniform(0.75, 1.3)
        self.capacity = {b: c * vary() for b, c in CAPACITY.items()}
        self.room = {b: h * vary() for b, h in ROOM.items()}
        self.along = {b: g * vary() for b, g in ALONG.items()}
        self.joints = {j: g[2] * vary() for j, g in JOINTS.items()}
        self.coolant = {b: h * vary() for b, h in COOLANT.items()}
        self.sources = {s: [w[0] * vary(), w[1], w[2]] for s, w in SOURCES.items()}
        self.air_K = {b: 0.0 for b in BODIES}
        self.lag_s = {}
        self.extra = None  # (body, W at every step): heat unrelated to any signal

    @staticmethod
    def cell(body, at):
        return BODIES.index(body) * CELLS + at

    def matrices(self, flows):
        size = len(BODIES) * CELLS
        conductance, capacity, air, wet = np.zeros((size, size)), np.zeros(size), np.zeros(size), \
            np.zeros(size)

        def join(a, b, g):
            conductance[a, a] += g
            conductance[b, b] += g
            conductance[a, b] -= g
            conductance[b, a] -= g
        for body in BODIES:
            cells = [self.cell(body, i) for i in range(CELLS)]
            capacity[cells] = self.capacity[body] / CELLS
            air[cells] = self.room[body] / CELLS
            for a, b in zip(cells[:-1], cells[1:]):
                join(a, b, self.along[body])
        for (a, b), g in self.joints.items():
            join(self.cell(a, JOINTS[a, b][0]), self.cell(b, JOINTS[a, b][1]), g)
        for body, h in self.coolant.items():
            wet[[self.cell(body, i) for i in range(CELLS)]] = h / CELLS if flows else 0.0
        return conductance + np.diag(air + wet), capacity, air, wet

    def fields(self, signals, room_degC, coolant_degC):
        """Temperatures of all cells [degC], shape (steps, cells), from equilibrium at rest.
        Backward Euler, stable for any time constant of a cell."""
        steps = []
        for flows in (False, True):
            conductance, capacity, air, wet = self.matrices(flows)
            inverse = np.linalg.inv(np.diag(capacity / STEP_S) + conductance)
            steps.append((inverse, capacity / STEP_S, air, wet, conductance))
        around = np.repeat([self.air_K[b] for b in BODIES], CELLS)
        heat = np.zeros((len(room_degC), len(around)))
        for (signal, body), (watt, exponent, cells) in self.sources.items():
            share = (signals[signal] / LARGEST[signal]) ** exponent
            heat[:, [self.cell(body, c) for c in cells]] += (watt * share / len(cells))[:, None]
        if self.extra:
            heat[:, self.cell(self.extra[0], 2)] += self.extra[1]
        _, _, air, _, conductance = steps[0]
        state = np.linalg.solve(conductance, air * (room_degC[0] + around))
        out = np.empty_like(heat)
        for i, watt in enumerate(heat):
            out[i] = state
            inverse, stored, air, wet, _ = steps[int(signals["coolant_on"][i] > 0)]
            state = inverse @ (stored * state + watt + air * (room_degC[i] + around) +
                               wet * coolant_degC[i])
        return out


class Network:
    """Network with one lump per body, as given to the diagnosis, and its fit."""

    def __init__(self, body):
        self.names = ([("capacity", b) for b in BODIES] + [("room", b) for b in BODIES] +
                      [("joints", j) for j in JOINTS] + [("coolant", b) for b in COOLANT] +
                      [("sources", s) for s in SOURCES])
        self.value = np.array([getattr(body, kind)[n][0] if kind == "sources" else
                               getattr(body, kind)[n] for kind, n in self.names])

    def of(self, kind, values=None):
        values = self.value if values is None else values
        return {n: v for (k, n), v in zip(self.names, values) if k == kind}

    def readings(self, values, run, sample):
        """Lump temperatures at every `sample`-th step."""
        n = len(BODIES)
        dt = STEP_S * sample
        capacity = np.array([self.of("capacity", values)[b] for b in BODIES])
        room = np.array([self.of("room", values)[b] for b in BODIES])
        wet = np.array([self.of("coolant", values).get(b, 0.0) for b in BODIES])
        base = np.diag(room)
        for (a, b), g in self.of("joints", values).items():
            i, j = BODIES.index(a), BODIES.index(b)
            base[[i, j, i, j], [i, j, j, i]] += np.array([g, g, -g, -g])
        sources = self.of("sources", values)
        heat = np.zeros((len(run["room"]), n))
        for (signal, body), watt in sources.items():
            heat[:, BODIES.index(body)] += watt * (run["signals"][signal] / LARGEST[signal]) ** \
                SOURCES[signal, body][1]
        steps = len(run["room"]) // sample
        mean = lambda x: x[:steps * sample].reshape(steps, sample, *x.shape[1:]).mean(axis=1)
        heat, air, cool = mean(heat), mean(run["room"]), mean(run["coolant"])
        flows = run["signals"]["coolant_on"][:steps * sample:sample] > 0
        keep = []
        for on in (False, True):
            k = base + np.diag(wet) * on
            root = np.sqrt(capacity)
            rate, shape = np.linalg.eigh(k / np.outer(root, root))
            decay = (shape * np.exp(-rate * dt)) @ shape.T * np.outer(1 / root, root)
            gain = (shape * (-np.expm1(-rate * dt) / rate)) @ shape.T / np.outer(root, root)
            keep.append((decay, gain))
        state = np.full(n, run["room"][0])
        out = np.empty((steps, n))
        for i in range(steps):
            out[i] = state
            decay, gain = keep[int(flows[i])]
            state = decay @ state + gain @ (heat[i] + room * air[i] + wet * flows[i] * cool[i])
        return out

    def fit(self, runs, sample):
        """Gauss-Newton in the logarithms of all values, with a prior at the body's own values."""
        start = np.log(self.value)
        at = start.copy()
        # A stronger prior for the coolant, which reaches one body and only at times.
        pull = 0.3 * np.ones(len(at))

        def left(x):
            parts = []
            for run in runs:
                lumps = self.readings(np.exp(x), run, sample)
                parts.append((lumps - run["true"][:len(lumps) * sample:sample]).ravel())
            return np.concatenate(parts + [pull * (x - start)])
        for _ in range(4):
            base = left(at)
            slope = np.stack([(left(at + 1e-3 * unit) - base) / 1e-3 for unit in np.eye(len(at))],
                             axis=1)
            at = at - np.clip(np.linalg.lstsq(slope, base, rcond=None)[0], -0.5, 0.5)
        self.value = np.exp(at)

    def write(self, sensors, lag_s):
        lines = ["format = 1", "[plant]", "[coolant]", 'signal = "coolant_on"', "temp_degC = 20.0"]
        for signal in LARGEST:
            lines += ["[[signal]]", 'name = "%s"' % signal, 'kind = "steps"', "times_s = [0]",
                      "values = [0]"]
        for body in BODIES:
            lines += ["[[node]]", 'name = "%s"' % body,
                      "capacity_J_per_K = %.6g" % self.of("capacity")[body],
                      "room_W_per_K = %.6g" % self.of("room")[body]]
            if body in COOLANT:
                lines.append("coolant_W_per_K = %.6g" % self.of("coolant")[body])
        for (a, b), g in self.of("joints").items():
            lines += ["[[link]]", 'between = ["%s", "%s"]' % (a, b),
                      "conductance_W_per_K = %.6g" % g]
        for (signal, body), watt in self.of("sources").items():
            lines += ["[[source]]", 'node = "%s"' % body, 'signal = "%s"' % signal,
                      "heat_W = %.6g" % watt, "at = %.1f" % LARGEST[signal],
                      "exponent = %.1f" % SOURCES[signal, body][1]]
        for name in list(sensors) + ["room", "coolant"]:
            lines += ["[[thermocouple]]", 'name = "%s"' % name, 'node = "%s"' % name]
        return "\n".join(lines) + "\n"


def centred_rms(values):
    return np.sqrt(np.mean((values - values.mean(axis=0)) ** 2, axis=0))


class NothingToSee(Exception):
    """No change of this kind is visible on this machine."""


class Case:
    def __init__(self, seed, level, attempt=0):
        self.random = np.random.default_rng([seed, level, 77] + [attempt] * (attempt > 0))
        self.level = LEVELS[level]
        self.sample = int(self.random.choice([6, 6, 12]))
        self.body = Body(self.random)
        self.sensors = [b for b in BODIES]
        self.inputs = {name: self._inputs(hours) for name, hours in RUNS}
        fitted = [self._inputs(16.0) for _ in range(2)]
        for run in fitted:
            run["true"] = self._true(self.body, run)
        self.network = Network(self.body)
        self.network.fit(fitted, self.sample)
        self.before = {name: self._true(self.body, run) for name, run in self.inputs.items()}
        self.left_K = self._left("train_a.csv")
        self.network.value *= 1.0 + self.level["wrong"] * self.random.normal(
            size=len(self.network.value))
        self.truth, self.steps = [], {}

    def _inputs(self, hours):
        steps = int(hours * 3600 / STEP_S)
        signals = plant.duty(self.random, steps)
        room = plant.room_air(self.random, steps, self.level["wander"])
        coolant = 20.0 + 0.5 * (room - 21.0)
        return dict(signals=signals, room=room, coolant=coolant)

    def _true(self, body, run):
        fields = body.fields(run["signals"], run["room"], run["coolant"])
        middle = [body.cell(b, 2) for b in BODIES]
        true = fields[:, middle].copy()
        for name, lag_s in body.lag_s.items():
            column = true[:, BODIES.index(name)]
            share = -np.expm1(-STEP_S / lag_s)
            state = column[0]
            for i, value in enumerate(column):
                state += share * (value - state)
                column[i] = state
        return true

    def _left(self, name):
        """RMS remainder of the fitted network on the untouched machine, per body."""
        lumps = self.network.readings(self.network.value, self.inputs[name], self.sample)
        return centred_rms(lumps - self.before[name][:len(lumps) * self.sample:self.sample])

    def hide(self, cause):
        """Changes the machine until the change is visible."""
        noise_K = max(self.level["noise_K"], self.level["step_K"] / np.sqrt(12.0))
        for _ in range(40):
            body, truth = self._changed(cause)
            after = {name: self._true(body, run) for name, run in self.inputs.items()}
            for name, column, values in truth.pop("add", []):
                after[name][:, BODIES.index(column)] += values
            run = truth["parameters"].get("run", "train_a.csv")
            moved = after[run] - self.before[run]
            # Another ambient temperature also shifts the initial equilibrium: visible is not the
            # change but the drift of the network from the initial readings.
            moved = np.abs(moved).mean(axis=0) if cause == "wrong_ambient" else centred_rms(moved)
            seen = moved > np.maximum(EFFECT_K, EXCEEDS * np.hypot(self.left_K, noise_K))
            if seen.any():
                self.body, self.after = body, after
                self.truth.append(truth)
                return
        raise NothingToSee(cause)

    def _changed(self, cause):
        random = self.random
        body = Body(np.random.default_rng(0))
        body.__dict__.update({k: (dict(v) if isinstance(v, dict) else v)
                              for k, v in self.body.__dict__.items()})
        factor = float(random.choice([random.uniform(0.3, 0.65), random.uniform(1.5, 2.8)]))
        truth = dict(cause=cause, subject="", parameters={})
        if cause == "wrong_film_coefficient":
            kind, name = [("room", b) for b in BODIES + ("head",)][random.integers(len(BODIES) + 1)]
            if random.uniform() < 0.15:
                kind, name = "coolant", "head"
            getattr(body, kind)[name] *= factor
            truth.update(subject="%s|%s" % (name, kind), parameters={"factor": factor})
        elif cause == "wrong_heat_source":
            at = list(SOURCES)[random.integers(len(SOURCES))]
            body.sources[at] = [body.sources[at][0] * factor] + body.sources[at][1:]
            truth.update(subject="|".join(at), parameters={"factor": factor})
        elif cause == "missing_heat_source":
            free = [(s, b) for s in LARGEST for b in BODIES if (s, b) not in SOURCES]
            at = free[random.integers(len(free))]
            power = int(random.choice([1, 2]))
            watt = float(random.uniform(20.0, 90.0))
            body.sources[at] = [watt, float(power), (1, 2, 3)]
            truth.update(subject="|".join(at), parameters={"heat_W": watt, "power": power})
        elif cause == "wrong_conductance":
            at = list(JOINTS)[random.integers(len(JOINTS))]
            body.joints[at] *= factor
            truth.update(subject="|".join(sorted(at)), parameters={"factor": factor})
        elif cause == "wrong_heat_capacity":
            name = BODIES[random.integers(len(BODIES))]
            body.capacity[name] *= factor
            truth.update(subject=name, parameters={"factor": factor})
        elif cause == "wrong_ambient":
            offset = float(random.choice([-1, 1]) * random.uniform(1.0, 4.0))
            name = "room" if random.uniform() < 0.5 else BODIES[random.integers(len(BODIES))]
            for b in BODIES:
                body.air_K[b] += offset if name in ("room", b) else 0.0
            truth.update(subject=name if name == "room" else name + "|room",
                         parameters={"offset_K": offset})
        else:
            self._change_reading(cause, body, truth)
        return body, truth

    def _change_reading(self, cause, body, truth):
        random = self.random
        name = self.sensors[random.integers(len(self.sensors))]
        truth["subject"] = name + "_degC"
        run = "train_a.csv" if random.uniform() < 0.5 else "train_b.csv"
        steps = len(self.inputs[run]["room"])
        hours = np.arange(steps) * STEP_S / 3600.0
        if cause == "slow_sensor":
            body.lag_s[name] = float(random.uniform(400.0, 2400.0))
            truth["parameters"] = {"tau_s": body.lag_s[name]}
        elif cause == "sensor_step":
            size = float(random.choice([-1, 1]) * random.uniform(1.0, 3.0))
            at = float(random.uniform(0.2, 0.8) * hours[-1])
            truth["parameters"] = {"run": run, "step_K": size, "at_s": 3600.0 * at}
            truth["add"] = [(run, name, size * (hours >= at))]
        elif cause == "sensor_drift":
            rate = float(random.choice([-1, 1]) * random.uniform(0.15, 0.5))
            truth["parameters"] = {"run": run, "rate_K_per_h": rate}
            truth["add"] = [(run, name, rate * hours)]
        elif cause == "outside_bursts":
            self._bursts(name, truth)
        else:
            walk = {r: np.cumsum(random.normal(size=len(x["room"]))) for r, x in self.inputs.items()}
            truth["add"] = [(r, name, 2.0 * w / centred_rms(w)) for r, w in walk.items()]

    def _bursts(self, name, truth):
        """Heat unrelated to any signal, added as the body's response."""
        truth["add"] = []
        for run, inputs in self.inputs.items():
            steps = len(inputs["room"])
            heat = np.repeat(self.random.choice([0.0, 0.0, 250.0], steps // 180 + 1), 180)[:steps]
            self.body.extra = (name, heat)
            warm = self._true(self.body, inputs)
            self.body.extra = None
            for i, body in enumerate(BODIES):
                truth["add"].append((run, body, warm[:, i] - self.before[run][:, i]))

    def write(self, folder):
        folder = pathlib.Path(folder)
        folder.mkdir(parents=True, exist_ok=True)
        after = getattr(self, "after", self.before)
        (folder / "machine.toml").write_text(self.network.write(self.sensors, {}))
        for name, inputs in self.inputs.items():
            rows = slice(None, None, self.sample)
            columns = {"time_s": np.arange(len(inputs["room"]))[rows] * STEP_S}
            for signal in LARGEST:
                columns[signal] = inputs["signals"][signal][rows]
            columns["x_mm"] = inputs["signals"]["x_mm"][rows]
            for body in self.sensors:
                columns[body + "_degC"] = self._read(after[name][rows, BODIES.index(body)])
            columns["room_degC"] = self._read(inputs["room"][rows])
            columns["coolant_degC"] = self._read(inputs["coolant"][rows])
            np.savetxt(folder / name, np.column_stack(list(columns.values())), fmt="%.7g",
                       delimiter=",", header=",".join(columns), comments="")
        hidden = [dict(t) for t in self.truth]
        oracle = np.hypot(self._left("test.csv"), np.hypot(self.level["noise_K"], self.level["step_K"] / np.sqrt(12.0)))
        (folder / "truth.json").write_text(json.dumps(dict(
            hidden=hidden, oracle_test_rms_K={b + "_degC": float(o)
                                              for b, o in zip(BODIES, oracle)})))

    def _read(self, degC):
        out = degC + self.level["noise_K"] * self.random.normal(size=len(degC))
        step = self.level["step_K"]
        return np.round(out / step) * step if step else out


def make(folder, seed, level, causes):
    """The first machine of the seed on which the causes are visible."""
    for attempt in range(10):
        case = Case(seed, level, attempt)
        try:
            for cause in causes:
                case.hide(cause)
            return case.write(folder)
        except NothingToSee:
            continue
    raise RuntimeError("no machine shows " + ", ".join(causes))
