"""One effect planted in measured columns: physical effects change displacement, sensor faults a
reading."""

import numpy as np

from hidden_effects import play
from measured_machines import low_pass, rms

FAMILIES = {
    "thermal_lag": "structure", "wrong_coefficient": "structure",
    "nonlinear_expansion": "structure", "missing_temperature": "structure",
    "position_dependence": "structure", "hysteresis": "structure", "slow_sensor": "structure",
    "missing_heat_source": "heat", "speed_growth": "heat", "displacement_step": "datum",
    "displacement_drift": "datum", "time_shift": "datum", "periodic_disturbance": "datum",
    "sensor_drift": "sensor", "sensor_step": "sensor", "sensor_loose": "sensor",
    "sensor_swap": "sensor"}
CAUSES = ("thermal_lag", "wrong_coefficient", "nonlinear_expansion", "missing_temperature",
          "hysteresis_output", "hysteresis_temperature", "slow_sensor", "missing_heat_source",
          "speed_growth", "displacement_step", "displacement_drift", "time_shift",
          "periodic_disturbance", "sensor_drift", "sensor_step", "sensor_loose", "sensor_swap")
OUTSIDE = ("outside_walk", "outside_chirp", "outside_bursts")  # unrelated to any recorded column
SHARE_MIN = 0.7  # least movement of the prediction by a sensor fault, relative to the wanted size


class Impossible(Exception):
    """This machine cannot carry the effect."""


class Planted:
    """A machine with one effect in it.

    @param times  size of the effect relative to the base model's remainder
    @param size_um  per output, for a second effect as large as the first
    """

    def __init__(self, machine, model, cause, times, random, size_um=None):
        self.machine, self.model, self.random = machine, model, random
        left = self.left()
        self.left_um = [rms(machine.train_parts(of)) for of in left]
        self.size_um = size_um or [max(1.0, times * um) for um in self.left_um]
        subject, parameters = getattr(self, "_" + cause)()
        named = "hysteresis" if cause.startswith("hysteresis") else cause
        self.truth = dict(cause=named, subject=subject, family=FAMILIES.get(named, "outside"),
                          parameters=parameters)

    def left(self):
        """Remainder of the model: by output, by run."""
        model, runs = self.model, self.machine.runs
        predicted = [model.predicted(run) for run in runs]
        return [[run[o] - run[o][0] - p[i] for run, p in zip(runs, predicted)]
                for i, o in enumerate(self.machine.outputs)]

    def _moves(self, values):
        return rms(self.machine.train_parts(values))

    def _add_scaled(self, values, first_only=False):
        """Adds the column to every output's displacement in the wanted size, with random sign.
        @return gains by output"""
        size = self._moves(values)
        if not size > 0:
            raise Impossible
        gains = {}
        for i, output in enumerate(self.machine.outputs[:1 if first_only else None]):
            gains[output] = float(self.random.choice([-1, 1]) * self.size_um[i] / size)
            for run, column in zip(self.machine.runs, values):
                run[output] = run[output] + gains[output] * column
        return gains

    def _add(self, values, output):
        for run, column in zip(self.machine.runs, values):
            run[output] = run[output] + column

    def _rises(self, name):
        return [self.machine.rise(run, name) for run in self.machine.runs]

    def _lagged(self, columns, tau_s):
        return [low_pass(r["time_s"], c, tau_s) for r, c in zip(self.machine.runs, columns)]

    def _input(self):
        return str(self.random.choice(self.model.inputs))

    def _tau_s(self, low_s, high_s):
        longest_s = max(r["time_s"][-1] for r in self.machine.runs) / 6.0
        high_s = min(high_s, longest_s)
        return float(np.exp(self.random.uniform(np.log(min(low_s, 0.5 * high_s)), np.log(high_s))))

    def _coefficients(self, name):
        """Coefficients by output, summed over the group of indistinguishable places."""
        group = self.machine.group(name)
        return [sum(k for k, n in zip(row, self.model.inputs) if n in group)
                for row in self.model.matrix]

    def _thermal_lag(self):
        for name in self.random.permutation(self.model.inputs):
            tau_s = self._tau_s(600.0, 7200.0)
            rises = self._rises(name)
            column = [b - a for a, b in zip(rises, self._lagged(rises, tau_s))]
            size = self._moves(column)
            coefficients = self._coefficients(name)
            if size > 0 and all(um <= abs(k) * size for um, k in zip(self.size_um, coefficients)):
                gains = {}
                for um, k, output in zip(self.size_um, coefficients, self.machine.outputs):
                    gains[output] = float(np.sign(k) * um / size)
                    self._add([gains[output] * c for c in column], output)
                return str(name), dict(tau_s=tau_s, gain_um_per_K=gains)
        raise Impossible

    def _wrong_coefficient(self):
        name = self._input()
        return name, dict(delta_um_per_K=self._add_scaled(self._rises(name)))

    def _nonlinear_expansion(self):
        name = self._input()
        return name, dict(gain_um_per_K2=self._add_scaled([t ** 2 for t in self._rises(name)]))

    def _missing_temperature(self):
        spare = [n for n in self.machine.temperatures if n not in self.model.inputs]
        if not spare:
            raise Impossible
        name = str(self.random.choice(spare))
        tau_s = float(self.random.choice([0.0, self._tau_s(900.0, 5400.0)]))
        rises = self._rises(name)
        gains = self._add_scaled(self._lagged(rises, tau_s) if tau_s else rises)
        return name, dict(tau_s=tau_s, gain_um_per_K=gains)

    def _reached(self, make, low, high, wanted):
        """The parameter between low and high for which make(parameter) has the wanted size."""
        for _ in range(40):
            middle = np.sqrt(low * high)
            low, high = (low, middle) if make(middle) > wanted else (middle, high)
        if not 0.9 < make(middle) / wanted < 1.1:
            raise Impossible
        return float(middle)

    def _hysteresis_output(self):
        output = self.machine.outputs[0]
        moved = [run[output] - run[output][0] for run in self.machine.runs]
        played = lambda width: [play(d, width) - d for d in moved]
        range_um = max(np.ptp(d) for d in moved)
        width = self._reached(lambda w: self._moves(played(w)), 0.01 * range_um, 0.7 * range_um,
                              self.size_um[0])
        self._add(played(width), output)
        return output, dict(width_um=width)

    def _hysteresis_temperature(self):
        name = self._input()
        rises = self._rises(name)
        k = self.model.matrix[:, self.model.inputs.index(name)]
        played = lambda width: [play(t, width) - t for t in rises]
        range_K = max(np.ptp(t) for t in rises)
        width = self._reached(lambda w: abs(k[0]) * self._moves(played(w)), 0.01 * range_K,
                              0.8 * range_K, self.size_um[0])
        for coefficient, output in zip(k, self.machine.outputs):
            self._add([coefficient * c for c in played(width)], output)
        return name, dict(width_K=width)

    def _false_reading(self, name, readings):
        """Movement of the prediction with these readings, relative to its wanted size."""
        changed = [dict(run, **{name: reading}) for run, reading in
                   zip(self.machine.runs, readings)]
        moved = [self.model.predicted(new) - self.model.predicted(old)
                 for new, old in zip(changed, self.machine.runs)]
        return max(rms(self.machine.train_parts([m[i] for m in moved])) / um
                   for i, um in enumerate(self.size_um))

    def _slow_sensor(self):
        name = self._input()
        slowed = lambda tau_s: self._lagged([r[name] for r in self.machine.runs], tau_s)
        tau_s = self._reached(lambda t: self._false_reading(name, slowed(t)), 60.0, 3600.0, 1.0)
        for run, reading in zip(self.machine.runs, slowed(tau_s)):
            run[name] = reading
        return name, dict(tau_s=tau_s)

    def _signal(self):
        if not self.machine.signals:
            raise Impossible
        return str(self.random.choice(self.machine.signals))

    def _missing_heat_source(self):
        name, power = self._signal(), int(self.random.integers(1, 3))
        tau_s = self._tau_s(400.0, 7200.0)
        values = self._lagged([r[name] ** power for r in self.machine.runs], tau_s)
        return name, dict(tau_s=tau_s, power=power, gain_um_per_unit=self._add_scaled(values))

    def _speed_growth(self):
        name = self._signal()
        if not name.endswith("_rpm"):
            raise Impossible
        return name, dict(gain_um_per_unit2=self._add_scaled([r[name] ** 2 for r in
                                                              self.machine.runs]))

    def _fault_run(self):
        able = [i for i, rows in enumerate(self.machine.train) if rows.stop]
        return int(self.random.choice(able))

    def _onset(self, number, low, high):
        time_s = self.machine.runs[number]["time_s"]
        rows = self.machine.train[number]
        return float(np.round(self.random.uniform(low, high) * time_s[rows.stop - 1]))

    def _in_run(self, number, values):
        return [values if i == number else np.zeros(len(run["time_s"]))
                for i, run in enumerate(self.machine.runs)]

    def _displacement_step(self):
        number = self._fault_run()
        at_s = self._onset(number, 0.2, 0.8)
        since = (self.machine.runs[number]["time_s"] >= at_s).astype(float)
        gains = self._add_scaled(self._in_run(number, since), first_only=True)
        return self.machine.outputs[0], dict(run=number, at_s=at_s, step_um=gains)

    def _displacement_drift(self):
        number = self._fault_run()
        hours = self.machine.runs[number]["time_s"] / 3600.0
        gains = self._add_scaled(self._in_run(number, hours), first_only=True)
        return self.machine.outputs[0], dict(run=number, rate_um_per_h=gains)

    def _time_shift(self):
        output = self.machine.outputs[0]
        moved = [(run["time_s"], run[output]) for run in self.machine.runs]
        sign = self.random.choice([-1, 1])
        shifted = lambda shift_s: [np.interp(t - sign * shift_s, t, d) - d for t, d in moved]
        shift_s = self._reached(lambda s: self._moves(shifted(s)), 10.0, 3600.0, self.size_um[0])
        self._add(shifted(shift_s), output)
        return output, dict(shift_s=float(sign * shift_s))

    def _periodic_disturbance(self):
        period_s = float(np.exp(self.random.uniform(np.log(900.0), np.log(6000.0))))
        waves = [np.sin(2 * np.pi * (run["time_s"] / period_s + self.random.uniform()))
                 for run in self.machine.runs]
        gains = self._add_scaled(waves, first_only=True)
        return self.machine.outputs[0], dict(period_s=period_s, amplitude_um=gains)

    def _sensor_fault(self, make):
        """@param make  (run, name) -> the false reading and its parameters"""
        number = self._fault_run()
        for name in self.random.permutation(self.model.inputs):
            name = str(name)
            false, parameters = make(number, name)
            readings = [false if i == number else run[name]
                        for i, run in enumerate(self.machine.runs)]
            if self._false_reading(name, readings) >= SHARE_MIN:
                self.machine.runs[number][name] = false
                return name, dict(run=number, **parameters)
        raise Impossible

    def _sensor_step(self):
        def make(number, name):
            run, at_s = self.machine.runs[number], self._onset(number, 0.2, 0.8)
            step_K = 2.0 * self.random.choice([-1, 1])
            return run[name] + step_K * (run["time_s"] >= at_s), dict(at_s=at_s, step_K=step_K)
        return self._sensor_fault(make)

    def _sensor_drift(self):
        def make(number, name):
            run, start_s = self.machine.runs[number], self._onset(number, 0.0, 0.3)
            rate = 4.0 / (run["time_s"][-1] - start_s) * self.random.choice([-1, 1])
            error = rate * np.maximum(0.0, run["time_s"] - start_s)
            return run[name] + error, dict(start_s=start_s, rate_K_per_h=3600.0 * rate)
        return self._sensor_fault(make)

    def _sensor_loose(self):
        def make(number, name):
            run, at_s = self.machine.runs[number], self._onset(number, 0.2, 0.7)
            rise = self.machine.rise(run, name)
            return (run[name] - 0.6 * rise * (run["time_s"] >= at_s), dict(at_s=at_s, gain=0.4))
        return self._sensor_fault(make)

    def _sensor_swap(self):
        inputs = self.model.inputs
        pairs = [(a, b) for a in inputs for b in inputs
                 if a < b and b not in self.machine.group(a)]
        for a, b in self.random.permutation(pairs) if pairs else ():
            a, b = str(a), str(b)
            changed = [dict(run, **{a: run[b], b: run[a]}) for run in self.machine.runs]
            moved = [self.model.predicted(new) - self.model.predicted(old)
                     for new, old in zip(changed, self.machine.runs)]
            share = rms(self.machine.train_parts([m[0] for m in moved])) / self.size_um[0]
            if 0.7 <= share <= 2.5:
                for run in self.machine.runs:
                    run[a], run[b] = run[b], run[a]
                return a + "|" + b, {}
        raise Impossible

    def _outside(self, unit):
        """@param unit  effect of unit size from a run's times"""
        return "", dict(gain_um=self._add_scaled([unit(r["time_s"]) for r in self.machine.runs]))

    def _outside_walk(self):
        return self._outside(lambda time_s: low_pass(
            time_s, np.cumsum(self.random.normal(size=len(time_s))), 1200.0))

    def _outside_chirp(self):
        """A sine whose period grows sevenfold during a run."""
        def unit(time_s):
            share = (time_s - time_s[0]) / (time_s[-1] - time_s[0])
            period_s = min(1500.0, time_s[-1] / 30.0) * 7.0 ** share
            return np.sin(2 * np.pi * np.cumsum(np.gradient(time_s) / period_s))
        return self._outside(unit)

    def _outside_bursts(self):
        def unit(time_s):
            hits = np.zeros(len(time_s))
            for at in self.random.integers(0, len(hits), 6):
                hits[at:at + max(2, len(hits) // 20)] += self.random.choice([-1.0, 1.0])
            return hits
        return self._outside(unit)
