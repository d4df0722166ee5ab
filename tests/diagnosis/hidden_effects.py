"""Simulated runs with effects hidden by seed: run files, a model file and the truth."""

import json
import pathlib

import numpy as np

import plant

RUNS = (("train_a.csv", 13.0), ("train_b.csv", 9.0), ("test.csv", 9.0))
LEVELS = {1: dict(sensor_K=0.01, step_K=0.0, noise_um=0.05, wander=False, coefficient=0.0),
          2: dict(sensor_K=0.03, step_K=0.1, noise_um=0.4, wander=True, coefficient=0.0),
          3: dict(sensor_K=0.03, step_K=0.1, noise_um=0.4, wander=True, coefficient=0.03)}
ALWAYS = ("thermal_lag", "slow_sensor", "time_shift", "missing_heat_source", "speed_growth",
          "missing_temperature", "wrong_coefficient", "nonlinear_expansion", "position_dependence",
          "hysteresis_output", "hysteresis_temperature", "periodic_disturbance", "sensor_swap")
EXCEEDS = 1.5  # least RMS of an effect relative to the remainder without it
FAULTS = ("displacement_step", "displacement_drift", "sensor_drift", "sensor_step", "sensor_loose")
OUTSIDE = ("outside_walk", "outside_chirp", "outside_bursts")
CAUSES = ALWAYS + FAULTS


def low_pass(values, tau_s, step_s=plant.STEP_S):
    share = -np.expm1(-step_s / tau_s)
    out = np.empty_like(values)
    state = values[0]
    for i, value in enumerate(values):
        state += share * (value - state)
        out[i] = state
    return out


def play(values, width):
    out = np.empty_like(values)
    state = values[0]
    for i, value in enumerate(values):
        state = min(max(state, value - width / 2), value + width / 2)
        out[i] = state
    return out


def rms(values):
    return float(np.sqrt(np.mean((values - values.mean()) ** 2)))


class Case:
    """One machine with its runs and base model; `hide` adds effects, `write` writes the files.

    Machines differ in outputs (one or two), rows (every 30, 60 or 120 s) and the source of
    displacement: the integral over the fields, which a few sensors follow only approximately, or
    the temperatures of the measured places, which a linear model follows exactly.
    """

    def __init__(self, seed, level):
        self.random = np.random.default_rng([seed, level])
        self.level = LEVELS[level]
        self.outputs = list(plant.OUTPUTS[:self.random.choice([1, 1, 2])])
        self.sample = int(self.random.choice([3, 6, 6, 12]))
        self.by_places = self.random.uniform() < 0.4
        self.machine = plant.Machine(self.random)
        self.inputs = list(self.random.permutation(list(plant.PLACES))[:self.random.integers(7, 10)])
        if "spindle_degC" not in self.inputs:
            self.inputs[0] = "spindle_degC"
        self.inputs.sort()
        self.place_um_per_K = {o: {n: self.random.uniform(2.0, 12.0) * self.random.choice([-1, 1])
                                   for n in self.inputs} for o in self.outputs}
        self.runs = {name: self._run(hours) for name, hours in RUNS}
        self._fit([self._run(16.0) for _ in range(3)])
        self.truth = []

    def _run(self, hours):
        steps = int(hours * 3600 / plant.STEP_S)
        signals = plant.duty(self.random, steps)
        room = plant.room_air(self.random, steps, self.level["wander"])
        fields = self.machine.run(signals, room)
        temps = {name: fields[:, self.machine.cells(body)[cell]]
                 for name, (body, cell) in plant.PLACES.items()}
        temps["room_degC"] = room.copy()
        moved = {o: self._moved(fields, temps, o) for o in self.outputs}
        return dict(time_s=np.arange(steps) * plant.STEP_S, signals=signals, temps=temps,
                    moved={o: d - d[0] for o, d in moved.items()},
                    readings={n: t.copy() for n, t in temps.items()})

    def _moved(self, fields, temps, output):
        if self.by_places:
            return sum(k * temps[n] for n, k in self.place_um_per_K[output].items())
        return self.machine.displacement(fields, output)

    def rise(self, run, name):
        return run["temps"][name] - run["temps"][name][0]

    def _fit(self, runs):
        """Best linear model of the unchanged machine: least squares on separate runs."""
        left = np.vstack([np.stack([self.rise(r, n)[::self.sample] for n in self.inputs], axis=1)
                          for r in runs])
        right = np.vstack([np.stack([r["moved"][o][::self.sample] for o in self.outputs], axis=1)
                           for r in runs])
        scale = left.std(axis=0)
        square = (left / scale).T @ (left / scale)
        square += 1e-4 * len(left) * np.eye(len(scale))
        self.matrix = (np.linalg.solve(square, (left / scale).T @ right) / scale[:, None]).T
        wrong = 1.0 + self.level["coefficient"] * self.random.normal(size=self.matrix.shape)
        self.model = self.matrix * wrong
        self.oracle_um = {o: self.left_um([self.runs["test.csv"]], o) for o in self.outputs}
        self.left_before_um = {o: self.left_um(self.train(), o, centred=True) for o in self.outputs}

    def left_um(self, runs, output, centred=False):
        """RMS remainder of the base model on the untouched machine, including noise."""
        parts = []
        for run in runs:
            row = self.model[self.outputs.index(output)]
            left = run["moved"][output] - sum(k * self.rise(run, n) for k, n in zip(row, self.inputs))
            parts.append((left - left.mean() * centred)[::self.sample])
        return float(np.hypot(np.sqrt(np.mean(np.concatenate(parts) ** 2)), self._noise_um(output)))

    def _noise_um(self, output):
        """Noise of a measured displacement with that of the readings' noise and steps."""
        reading_K = np.hypot(self.level["sensor_K"], self.level["step_K"] / np.sqrt(12.0))
        row = self.model[self.outputs.index(output)]
        return float(np.hypot(self.level["noise_um"], reading_K * np.linalg.norm(row)))

    def train(self):
        return [self.runs[name] for name, _ in RUNS if name != "test.csv"]

    def predicted(self, run, output):
        row = self.matrix[self.outputs.index(output)]
        return sum(k * self.rise(run, n) for k, n in zip(row, self.inputs))

    def size_um(self, effect, runs=None):
        """RMS of an effect over the training rows, maximum over the outputs."""
        runs = runs if runs is not None else self.train()
        return max(rms(np.concatenate([effect(r, o) - np.mean(effect(r, o)) for r in runs]))
                   for o in self.outputs)

    def _add(self, effect, runs=None):
        for run in runs if runs is not None else self.runs.values():
            added = {o: effect(run, o) for o in self.outputs}
            for output in self.outputs:
                run["moved"][output] = run["moved"][output] + added[output]

    def _scaled(self, effect, runs=None, low=2.0, high=6.0):
        """Gain that scales a unit effect to a random size, with random sign."""
        size = self.size_um(effect, runs)
        if not size > 0:
            raise ValueError("no effect")
        return self.random.choice([-1.0, 1.0]) * self.random.uniform(low, high) / size

    def _reached(self, effect, low=1.5):
        size = self.size_um(effect)
        if not low <= size <= 9.0:
            raise ValueError("effect of %.2f um" % size)

    def _weights(self):
        return {o: (1.0 if i == 0 else self.random.uniform(0.4, 1.0) * self.random.choice([-1, 1]))
                for i, o in enumerate(self.outputs)}

    def strong_input(self):
        """An input with sufficient effect on displacement."""
        sizes = {n: max(abs(self.matrix[i, j]) * rms(np.concatenate(
            [self.rise(r, n) for r in self.train()])) for i in range(len(self.outputs)))
            for j, n in enumerate(self.inputs)}
        able = [n for n, s in sizes.items() if s > 4.0]
        if not able:
            raise ValueError("no strong input")
        return str(self.random.choice(able))

    def k(self, name, output):
        return self.matrix[self.outputs.index(output), self.inputs.index(name)]

    def hide(self, cause):
        before = {id(r): (dict(r["moved"]), dict(r["readings"])) for r in self.train()}
        subject, parameters = getattr(self, "_" + cause)()
        self._exceeds_noise(before)
        named = "hysteresis" if cause.startswith("hysteresis") else cause
        self.truth.append(dict(cause=named, subject=subject, parameters=parameters))

    def _exceeds_noise(self, before):
        """@throws ValueError if the hidden effect is smaller than the remainder without it"""
        for output in self.outputs:
            parts = []
            for run in self.train():
                moved, readings = before[id(run)]
                change = run["moved"][output] - moved[output]
                for k, n in zip(self.matrix[self.outputs.index(output)], self.inputs):
                    change = change - k * (run["readings"][n] - readings[n])
                parts.append(change - change.mean())
            if rms(np.concatenate(parts)) > EXCEEDS * self.left_before_um[output]:
                return
        raise ValueError("less than the noise")

    def _thermal_lag(self):
        name, tau_s = self.strong_input(), float(self.random.uniform(600, 5400))
        share = float(self.random.uniform(0.4, 1.0))
        effect = lambda r, o: share * self.k(name, o) * (
            low_pass(self.rise(r, name), tau_s) - self.rise(r, name))
        self._reached(effect)
        self._add(effect)
        return name, dict(tau_s=tau_s)

    def _slow_sensor(self):
        name, tau_s = self.strong_input(), float(self.random.uniform(200, 1500))
        self._reached(lambda r, o: self.k(name, o) * (
            self.rise(r, name) - low_pass(self.rise(r, name), tau_s)))
        for run in self.runs.values():
            run["readings"][name] = low_pass(run["readings"][name], tau_s)
        return name, dict(tau_s=tau_s)

    def _time_shift(self):
        output, shift_s = self.outputs[0], float(self.random.uniform(300, 1800))
        shift_s *= self.random.choice([-1, 1])
        def effect(r, o):
            if o != output:
                return np.zeros(len(r["time_s"]))
            d = r["moved"][o]
            return np.interp(r["time_s"] - shift_s, r["time_s"], d) - d
        self._reached(effect)
        self._add(effect)
        return output, dict(shift_s=shift_s)

    def _signal(self, names=("spindle_rpm", "feed_mm_per_min", "coolant_on")):
        return str(self.random.choice(names))

    def _missing_heat_source(self):
        name, tau_s = self._signal(), float(self.random.uniform(400, 7200))
        power = int(self.random.integers(1, 3)) if name != "coolant_on" else 1
        weights = self._weights()
        unit = lambda r, o: weights[o] * low_pass(r["signals"][name] ** power, tau_s)
        gain = self._scaled(unit)
        self._add(lambda r, o: gain * unit(r, o))
        return name, dict(tau_s=tau_s, power=power)

    def _speed_growth(self):
        weights = self._weights()
        name = self._signal(("spindle_rpm", "feed_mm_per_min"))
        unit = lambda r, o: weights[o] * r["signals"][name] ** 2
        gain = self._scaled(unit)
        self._add(lambda r, o: gain * unit(r, o))
        return name, dict(gain_um_per_unit2={o: gain * w for o, w in weights.items()})

    def _missing_temperature(self):
        spare = [n for n in list(plant.PLACES) + ["room_degC"] if n not in self.inputs]
        name, weights = str(self.random.choice(spare)), self._weights()
        tau_s = float(self.random.choice([0.0, self.random.uniform(900, 5400)]))
        unit = lambda r, o: weights[o] * (low_pass(self.rise(r, name), tau_s) if tau_s else
                                          self.rise(r, name))
        gain = self._scaled(unit)
        self._add(lambda r, o: gain * unit(r, o))
        return name, dict(tau_s=tau_s)

    def _wrong_coefficient(self):
        name, weights = str(self.random.choice(self.inputs)), self._weights()
        unit = lambda r, o: weights[o] * self.rise(r, name)
        gain = self._scaled(unit)
        self._add(lambda r, o: gain * unit(r, o))
        return name, dict(delta_um_per_K={o: gain * w for o, w in weights.items()})

    def _nonlinear_expansion(self):
        name, weights = str(self.random.choice(self.inputs)), self._weights()
        unit = lambda r, o: weights[o] * self.rise(r, name) ** 2
        gain = self._scaled(unit)
        self._add(lambda r, o: gain * unit(r, o))
        return name, dict(gain_um_per_K2={o: gain * w for o, w in weights.items()})

    def _position_dependence(self):
        name, weights = str(self.random.choice(self.inputs)), self._weights()
        p0 = float(self.random.uniform(100, 400))
        unit = lambda r, o: weights[o] * (r["signals"]["x_mm"] - p0) * self.rise(r, name)
        gain = self._scaled(unit)
        self._add(lambda r, o: gain * unit(r, o))
        return "|".join(sorted([name, "x_mm"])), dict(p0_mm=p0)

    def _hysteresis_output(self):
        output = self.outputs[0]
        d = self.train()[0]["moved"][output]
        width = float(self.random.uniform(0.15, 0.5) * (d.max() - d.min()))
        effect = lambda r, o: (play(r["moved"][o], width) - r["moved"][o] if o == output else
                               np.zeros(len(r["time_s"])))
        self._reached(effect)
        self._add(effect)
        return output, dict(width_um=width)

    def _hysteresis_temperature(self):
        name = self.strong_input()
        t = self.rise(self.train()[0], name)
        width = float(self.random.uniform(0.15, 0.5) * (t.max() - t.min()))
        effect = lambda r, o: self.k(name, o) * (play(self.rise(r, name), width)
                                                 - self.rise(r, name))
        self._reached(effect)
        self._add(effect)
        return name, dict(width_K=width)

    def _periodic_disturbance(self):
        output, period_s = self.outputs[0], float(self.random.uniform(700, 5000))
        amplitude = float(self.random.uniform(2.0, 6.0) * np.sqrt(2))
        phase = {id(r): self.random.uniform(0, 6.28) for r in self.runs.values()}
        self._add(lambda r, o: (o == output) * amplitude * np.sin(
            2 * np.pi * r["time_s"] / period_s + phase[id(r)]))
        return output, dict(period_s=period_s, amplitude_um=amplitude)

    def _sensor_swap(self):
        pairs = [(a, b) for a in self.inputs for b in self.inputs if a < b]
        self.random.shuffle(pairs)
        for a, b in pairs:
            effect = lambda r, o: (self.k(a, o) - self.k(b, o)) * (self.rise(r, b)
                                                                   - self.rise(r, a))
            if 2.0 <= self.size_um(effect) <= 9.0:
                for run in self.runs.values():
                    run["readings"][a], run["readings"][b] = run["readings"][b], run["readings"][a]
                return a + "|" + b, {}
        raise ValueError("no pair")

    def _fault_run(self):
        name = ("train_a.csv", "train_b.csv")[int(self.random.integers(0, 2))]
        return name, self.runs[name]

    def _onset(self, run, low=0.2, high=0.8):
        return float(np.round(self.random.uniform(low, high) * run["time_s"][-1]))

    def _displacement_step(self):
        name, run = self._fault_run()
        at_s, output = self._onset(run), self.outputs[0]
        step = float(self.random.choice([-1, 1]) * self.random.uniform(5, 14))
        run["moved"][output] = run["moved"][output] + step * (run["time_s"] >= at_s)
        return output, dict(run=name, at_s=at_s, step_um=step)

    def _displacement_drift(self):
        name, run = self._fault_run()
        rate = float(self.random.choice([-1, 1]) * self.random.uniform(1.0, 2.5))
        output = self.outputs[0]
        run["moved"][output] = run["moved"][output] + rate * run["time_s"] / 3600.0
        return output, dict(run=name, rate_um_per_h=rate)

    def _sensor_fault(self, make, parameters):
        run_name, run = self._fault_run()
        sensors = list(self.inputs)
        self.random.shuffle(sensors)
        for name in sensors:
            error, values = make(run, name)
            size = max(rms(self.k(name, o) * error) for o in self.outputs)
            if 2.0 <= size <= 8.0:
                run["readings"][name] = run["readings"][name] + error
                return str(name), dict(run=run_name, **values)
        raise ValueError("no sensor carries it")

    def _sensor_drift(self):
        def make(run, name):
            start_s = self._onset(run, 0.1, 0.6)
            rate = float(self.random.choice([-1, 1]) * self.random.uniform(0.3, 1.2))
            return (rate * np.maximum(0.0, run["time_s"] - start_s) / 3600.0,
                    dict(start_s=start_s, rate_K_per_h=rate))
        return self._sensor_fault(make, None)

    def _sensor_step(self):
        def make(run, name):
            at_s = self._onset(run)
            step = float(self.random.choice([-1, 1]) * self.random.uniform(0.8, 4.0))
            return step * (run["time_s"] >= at_s), dict(at_s=at_s, step_K=step)
        return self._sensor_fault(make, None)

    def _sensor_loose(self):
        def make(run, name):
            at_s = self._onset(run, 0.2, 0.7)
            gain = float(self.random.uniform(0.3, 0.8))
            error = (gain - 1.0) * (run["temps"][name] - run["temps"]["room_degC"])
            return error * (run["time_s"] >= at_s), dict(at_s=at_s, gain=gain)
        return self._sensor_fault(make, None)

    def _outside_walk(self):
        walks = {}
        def unit(r, o):
            if id(r) not in walks:
                steps = self.random.normal(size=len(r["time_s"]))
                walks[id(r)] = low_pass(np.cumsum(steps), 1200.0)
            return walks[id(r)]
        gain = self._scaled(unit)
        self._add(lambda r, o: gain * unit(r, o))
        return "", {}

    def _outside_chirp(self):
        """A sine whose period grows from 25 minutes to three hours during a run."""
        def unit(r, o):
            share = r["time_s"] / r["time_s"][-1]
            period_s = 1500.0 * 7.0 ** share
            return np.sin(2 * np.pi * np.cumsum(plant.STEP_S / period_s))
        gain = self._scaled(unit)
        self._add(lambda r, o: gain * unit(r, o))
        return "", {}

    def _outside_bursts(self):
        bursts = {}
        def unit(r, o):
            if id(r) not in bursts:
                hits = np.zeros(len(r["time_s"]))
                for at in self.random.integers(0, len(hits), 6):
                    hits[at:at + 90] += self.random.choice([-1.0, 1.0])
                bursts[id(r)] = low_pass(hits, 1200.0)
            return bursts[id(r)]
        gain = self._scaled(unit)
        self._add(lambda r, o: gain * unit(r, o))
        return "", {}

    def write(self, folder):
        folder = pathlib.Path(folder)
        folder.mkdir(parents=True, exist_ok=True)
        temperatures = list(plant.PLACES) + ["room_degC"]
        names = ["time_s", "spindle_rpm", "feed_mm_per_min", "coolant_on", "x_mm"] + temperatures
        for file_name, run in self.runs.items():
            rows = slice(None, None, self.sample)
            columns = [run["time_s"][rows]]
            columns += [run["signals"][n][rows] for n in names[1:5]]
            for name in temperatures:
                reading = run["readings"][name][rows]
                reading = reading + self.random.normal(0, self.level["sensor_K"], len(reading))
                if self.level["step_K"]:
                    reading = np.round(reading / self.level["step_K"]) * self.level["step_K"]
                columns.append(reading)
            for output in self.outputs:
                noise = self.random.normal(0, self.level["noise_um"], len(columns[0]))
                columns.append(run["moved"][output][rows] + noise)
            np.savetxt(folder / file_name, np.stack(columns, axis=1), fmt="%.6g", delimiter=",",
                       header=",".join(names + self.outputs), comments="")
        quoted = lambda values: "[" + ", ".join('"%s"' % v for v in values) + "]"
        matrix = ",\n  ".join("[" + ", ".join("%.9g" % k if "." in "%.9g" % k else "%.9g.0" % k
                                               for k in row) + "]" for row in self.model)
        (folder / "model.toml").write_text(
            'format = 1\ninputs = %s\noutputs = %s\nreference = "first_sample"\n'
            "matrix_um_per_K = [\n  %s\n]\n" % (quoted(self.inputs), quoted(self.outputs), matrix))
        facts = dict(hidden=self.truth, oracle_test_rms_um=self.oracle_um,
                     left_before_um=self.left_before_um)
        (folder / "truth.json").write_text(json.dumps(facts, indent=1))


def make(folder, seed, level, causes):
    """Tries machines by seed until every cause has a subject that can carry it."""
    for attempt in range(200):
        case = Case(seed * 1000 + attempt, level)
        try:
            for cause in causes:
                case.hide(cause)
        except ValueError:
            continue
        case.write(folder)
        return case
    raise RuntimeError("no machine carries %s with seed %d" % (causes, seed))
