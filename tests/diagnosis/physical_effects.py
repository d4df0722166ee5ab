"""Effects of bodies, joints, films and clocks, hidden in simulated machines by seed.

A body without a thermocouple is a rod of cells with conduction and a film to the room; a joint is a
row of sliders; a sensor is one or two thermal masses. Each resembles a form of the diagnosis only
approximately, as on a real machine.
"""

import numpy as np

import hidden_effects as hidden
import plant

SIZES = (1.0, 3.0, 10.0, 50.0)  # relative to the base model's remainder
CELLS = 8
STEP_S = plant.STEP_S


def rod(steps, source_K_per_s, room_K, room_s, along_s, host_K=None, contact_s=None):
    """Rises of a rod's cells [K], shape (steps, CELLS), from equilibrium.
    @param source_K_per_s  of the first cell
    @param room_K          rise of the room
    @param room_s          time constant of the film, one number or one per step
    @param host_K          rise of the body that touches the first cell"""
    between = CELLS ** 2 / along_s
    to_room = 1.0 / np.broadcast_to(room_s, steps)
    rises = np.zeros((steps, CELLS))
    rise = np.zeros(CELLS)
    parts = int(np.ceil(2.2 * STEP_S * (between + (CELLS / contact_s if contact_s else 0.0)))) or 1
    for i in range(steps):
        rises[i] = rise
        for _ in range(parts):
            flow = between * np.diff(rise)
            rate = to_room[i] * (room_K[i] - rise)
            rate[:-1] += flow
            rate[1:] -= flow
            rate[0] += CELLS * source_K_per_s[i]
            if host_K is not None:
                rate[0] += CELLS / contact_s * (host_K[i] - rise[0])
            rise = rise + STEP_S / parts * rate
    return rises


class PhysicalCase(hidden.Case):
    """A machine with one such effect, `times` the model's remainder."""

    def __init__(self, seed, level, times):
        super().__init__(seed, level)
        self.times = times
        self.size_um_wanted = {o: times * self.left_before_um[o] for o in self.outputs}

    def hide(self, kind):
        cause, subject, parameters = getattr(self, "_" + kind)()
        self.truth.append(dict(cause=cause, subject=subject, parameters=parameters, kind=kind))

    def group(self, name):
        """Temperatures whose rises cannot be distinguished from this one's in the training rows."""
        stacked = lambda of: np.concatenate([self.rise(r, of) for r in self.train()])
        return {n for n in self.runs["test.csv"]["temps"] if n == name or
                np.corrcoef(stacked(name), stacked(n))[0, 1] > 0.98}

    def _room(self, run):
        return run["temps"]["room_degC"] - run["temps"]["room_degC"][0]

    def _zeros(self, run):
        return np.zeros(len(run["time_s"]))

    def _moves(self, values, first_only=False, positive=False):
        """Adds the column of each run to every output in the wanted size."""
        runs = list(self.runs.values())
        columns = {id(r): values(r) for r in runs}
        size = hidden.rms(np.concatenate([columns[id(r)] - columns[id(r)].mean()
                                          for r in self.train()]))
        if not size > 0:
            raise ValueError("no effect")
        for i, output in enumerate(self.outputs[:1 if first_only else None]):
            share = 1.0 if i == 0 else self.random.uniform(0.4, 1.0)
            sign = 1.0 if positive else self.random.choice([-1.0, 1.0])
            for run in runs:
                run["moved"][output] = (run["moved"][output] + sign * share *
                                        self.size_um_wanted[output] / size * columns[id(run)])

    def _rod_of_signal(self, signal, power, room_s, along_s, feedback=0.0, delay_s=0.0, film=0.0):
        def values(run):
            u = run["signals"][signal]
            u = (u / max(u.max(), 1.0)) ** power
            late = int(delay_s / STEP_S)
            u = np.concatenate([np.zeros(late), u])[:len(u)]
            films_s = room_s / (1.0 + film * u)
            heat = 0.004 * u
            rises = rod(len(u), heat, self._room(run), films_s, along_s)
            for _ in range(2 if feedback else 0):  # heat grows with the rise it causes
                heat = 0.004 * u * (1.0 + feedback * rises[:, 0])
                rises = rod(len(u), heat, self._room(run), films_s, along_s)
            return rises.mean(axis=1) + 0.3 * rises[:, -1]
        self._moves(values)
        return "missing_heat_source", signal, {}

    def _times(self):
        return self.random.uniform(1500.0, 9000.0), self.random.uniform(600.0, 6000.0)

    def _unseen_body(self):
        return self._rod_of_signal(self._signal(), self.random.uniform(1.0, 1.6), *self._times())

    def _film_with_speed(self):
        return self._rod_of_signal("spindle_rpm", 1.3, *self._times(), film=2.0)

    def _preload(self):
        return self._rod_of_signal("spindle_rpm", 1.0, *self._times(), feedback=0.06)

    def _late_coolant(self):
        return self._rod_of_signal("coolant_on", 1.0, *self._times(),
                                   delay_s=self.random.uniform(120.0, 600.0))

    def _slow_mass(self):
        """A share of the place's effect comes from a mass behind it."""
        name, contact_s = self.strong_input(), self.random.uniform(400.0, 2500.0)
        along_s = self.random.uniform(600.0, 6000.0)
        late = {}
        for run in self.runs.values():
            rise = self.rise(run, name)
            mass = rod(len(rise), self._zeros(run), rise, 60000.0, along_s, rise, contact_s)
            late[id(run)] = mass.mean(axis=1) - rise
        size_K = hidden.rms(np.concatenate([late[id(r)] - late[id(r)].mean()
                                            for r in self.train()]))
        share = self.size_um_wanted[self.outputs[0]] / abs(self.k(name, self.outputs[0])) / size_K
        if not 0.0 < share <= 1.0:
            raise ValueError("a share of %.2f" % share)
        for run in self.runs.values():
            for output in self.outputs:
                run["moved"][output] = (run["moved"][output] +
                                        share * self.k(name, output) * late[id(run)])
        return "thermal_lag", name, {}

    def _rod_at(self, name):
        contact_s, along_s = self.random.uniform(60.0, 900.0), self.random.uniform(300.0, 3000.0)
        self._moves(lambda run: rod(len(run["time_s"]), self._zeros(run), self._room(run), 40000.0,
                                    along_s, self.rise(run, name), contact_s).mean(axis=1))
        return "missing_temperature", name, {}

    def _warped_reference(self):
        """The reference artefact follows the room temperature."""
        film_s, along_s = self.random.uniform(900.0, 7200.0), self.random.uniform(300.0, 3000.0)
        self._moves(lambda run: rod(len(run["time_s"]), self._zeros(run), self._room(run), film_s,
                                    along_s).mean(axis=1))
        return "missing_temperature", "room_degC", {}

    def _body_left_out(self):
        spare = [n for n in plant.PLACES if n not in self.inputs]
        return self._rod_at(str(self.random.choice(spare)))

    def _other_material(self):
        """A bracket with another expansion coefficient and a small lag."""
        name = self.strong_input()
        along_s = self.random.uniform(60.0, 300.0)
        self._moves(lambda run: rod(len(run["time_s"]), self._zeros(run), self._room(run), 60000.0,
                                    along_s, self.rise(run, name), 30.0).mean(axis=1))
        return "wrong_coefficient", name, {}

    def _softening(self):
        """Expansion that grows with temperature, over a body with a gradient."""
        name = self.strong_input()
        self._moves(lambda run: self.rise(run, name) ** 2 * 0.7 +
                    0.3 * hidden.low_pass(self.rise(run, name), 400.0) ** 2)
        return "nonlinear_expansion", name, {}

    def _reached(self, change, low, high):
        """The parameter for which the change of the first output has the wanted size."""
        wanted = self.size_um_wanted[self.outputs[0]]
        size = lambda p: hidden.rms(np.concatenate(
            [v - v.mean() for v in (change(p, run) for run in self.train())]))
        for _ in range(30):
            middle = np.sqrt(low * high)
            low, high = (low, middle) if size(middle) > wanted else (middle, high)
        if not 0.8 < size(middle) / wanted < 1.25:
            raise ValueError("size not reached")
        return float(middle)

    def _friction(self):
        """A joint of five sliders with different friction."""
        output = self.outputs[0]
        holds = self.random.uniform(0.5, 1.5, 5)
        def change(width, run):
            d = run["moved"][output]
            return np.mean([hidden.play(d, width * h) for h in holds], axis=0) - d
        range_um = np.ptp(self.train()[0]["moved"][output])
        width = self._reached(change, 0.01 * range_um, 0.7 * range_um)
        for run in self.runs.values():
            run["moved"][output] = run["moved"][output] + change(width, run)
        return "hysteresis", output, {}

    def _late_clock(self):
        """A logger with a late and slightly slow clock."""
        output = self.outputs[0]
        sign = self.random.choice([-1.0, 1.0])
        def change(shift_s, run):
            t, d = run["time_s"], run["moved"][output]
            return np.interp(t - sign * shift_s * (0.85 + 0.3 * t / t[-1]), t, d) - d
        shift_s = self._reached(change, 20.0, 3600.0)
        for run in self.runs.values():
            run["moved"][output] = run["moved"][output] + change(shift_s, run)
        return "time_shift", output, {}

    def _changes_reading(self, name, make, low, high, runs):
        """Replaces each run's reading by make(parameter, run), with the wanted effect."""
        output = self.outputs[0]
        change = lambda p, run: (self.k(name, output) * (make(p, run) - run["temps"][name])
                                 if any(run is r for r in runs) else self._zeros(run))
        value = self._reached(change, low, high)
        for run in runs:
            run["readings"][name] = make(value, run)
        return value

    def _two_masses(self):
        """A sensor cartridge in a sleeve."""
        name = self.strong_input()
        make = lambda tau_s, run: hidden.low_pass(hidden.low_pass(run["temps"][name], tau_s),
                                                  tau_s / 3.0)
        self._changes_reading(name, make, 20.0, 2700.0, self.runs.values())
        return "slow_sensor", name, {}

    def _one_run(self):
        name, run = self._fault_run()
        return name, run, self._onset(run, 0.2, 0.7)

    def _loose_cartridge(self):
        """A contact that becomes poor: a mass between its place and the room."""
        run_name, faulty, at_s = self._one_run()
        name = self.strong_input()
        def make(poor, run):
            place, room = run["temps"][name], run["temps"]["room_degC"]
            reading = place.copy()
            state = None
            for i in range(len(place)):
                if run["time_s"][i] < at_s:
                    continue
                state = place[i] if state is None else state
                state += STEP_S / 120.0 * ((place[i] - state) + poor * (room[i] - state))
                reading[i] = state
            return reading
        self._changes_reading(name, make, 0.02, 20.0, [faulty])
        return "sensor_loose", name, dict(run=run_name)

    def _ageing_sensor(self):
        """Decalibration, fast at first."""
        run_name, faulty = self._fault_run()
        start_s = self._onset(faulty, 0.0, 0.3)
        name, sign = self.strong_input(), self.random.choice([-1.0, 1.0])
        def make(size_K, run):
            since_s = np.maximum(0.0, run["time_s"] - start_s)
            course = np.log1p(since_s / 20000.0)
            return run["temps"][name] + sign * size_K * course / course[-1]
        self._changes_reading(name, make, 0.05, 60.0, [faulty])
        return "sensor_drift", name, dict(run=run_name)

    def _bad_contact(self):
        """A jump that settles within minutes."""
        run_name, faulty, at_s = self._one_run()
        name, sign = self.strong_input(), self.random.choice([-1.0, 1.0])
        def make(step_K, run):
            since_s = run["time_s"] - at_s
            return run["temps"][name] + sign * step_K * np.where(
                since_s >= 0, 1.0 - 0.25 * np.exp(-np.maximum(since_s, 0.0) / 300.0), 0.0)
        self._changes_reading(name, make, 0.05, 60.0, [faulty])
        return "sensor_step", name, dict(run=run_name)

    def _in_one_run(self, faulty, values):
        self._moves(lambda run: values(run) if run is faulty else self._zeros(run), True)

    def _knocked_probe(self):
        run_name, faulty, at_s = self._one_run()
        self._in_one_run(faulty, lambda run: np.where(
            run["time_s"] >= at_s,
            1.0 - 0.2 * np.exp(-np.maximum(run["time_s"] - at_s, 0.0) / 600.0), 0.0))
        return "displacement_step", self.outputs[0], dict(run=run_name)

    def _creeping_mount(self):
        run_name, faulty = self._fault_run()
        self._in_one_run(faulty, lambda run: (run["time_s"] / 3600.0) ** 0.8)
        return "displacement_drift", self.outputs[0], dict(run=run_name)

    def _bearing_seat(self):
        """Grows with the square of speed, saturates, with a time constant below a minute."""
        def values(run):
            square = (run["signals"]["spindle_rpm"] / 6000.0) ** 2
            return hidden.low_pass(square / (1.0 + 0.15 * square), 25.0)
        self._moves(values)
        return "speed_growth", "spindle_rpm", {}

    def _hunting_cooler(self):
        """A two-point controller that warms and cools a cabinet at two rates."""
        period_s, share = self.random.uniform(900.0, 5000.0), self.random.uniform(0.35, 0.65)
        def values(run):
            phase = (run["time_s"] / period_s + self.random.uniform()) % 1.0
            saw = np.where(phase < share, phase / share, (1.0 - phase) / (1.0 - share))
            return hidden.low_pass(saw, 0.05 * period_s)
        self._moves(values, True)
        return "periodic_disturbance", self.outputs[0], {}


KINDS = ("unseen_body", "film_with_speed", "preload", "late_coolant", "slow_mass",
         "warped_reference", "body_left_out", "other_material", "softening", "friction",
         "late_clock", "two_masses", "loose_cartridge", "ageing_sensor", "bad_contact",
         "knocked_probe", "creeping_mount", "bearing_seat", "hunting_cooler")


def make(folder, seed, level, kind, times):
    """Tries machines by seed until one carries the effect.
    @return the case; None: no machine carries it"""
    for attempt in range(12):
        case = PhysicalCase(seed * 1000 + attempt, level, times)
        try:
            case.hide(kind)
        except ValueError:
            continue
        case.write(folder)
        return case
    return None
