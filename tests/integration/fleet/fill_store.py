"""Two hundred machines of four types in five halls, with a year of nights."""

MACHINES = 200
COLUMNS = ["head_degC", "column_degC", "bed_degC", "spindle_rpm", "z_offset_um"]
# Machine 7: its head has been hotter for ten days, and it departs.
ODD = "mill_007"

FILL = """
INSERT INTO fleet.machine (name, type, hall)
  SELECT format('mill_%s', lpad(i::text, 3, '0')), 'type_' || i % 4, 'hall ' || (i / 4) % 5 + 1 FROM generate_series(0, {machines} - 1) i;
INSERT INTO fleet.document (checksum, kind, content) SELECT encode(sha256('x'), 'hex'), 'model', 'x';
INSERT INTO fleet.setup (machine, number, configuration, model, columns, program_version)
  SELECT id, 1, encode(sha256('x'), 'hex'), encode(sha256('x'), 'hex'), '{{{columns}}}', '1' FROM fleet.machine;
INSERT INTO fleet.uplink (machine, history, newest, seen)
  SELECT id, 'history.db', now(), now() - CASE WHEN id % 40 = 0 THEN interval '3 days' ELSE interval '20 s' END FROM fleet.machine;
INSERT INTO fleet.night_result (machine, night, model, program_version, state, departs, probability, departure, remainder_um, claimed_um)
  SELECT id, day::date, '', '1', 'done', name = '{odd}' AND day >= now() - interval '10 days',
    0.5, CASE WHEN name = '{odd}' THEN '{{"sisters": {{"z_um": {{"departs": true, "subjects":
      [{{"subject": "head_degC", "share": 0.8, "effect_um": 9.1}}]}}}}}}'::jsonb END, (1.5 + 0.5 * sin(id)) * CASE WHEN name = '{odd}' AND day >= now() - interval '10 days' THEN 6 ELSE 1 END, 2
  FROM fleet.machine, generate_series(now() - interval '364 days', now() - interval '1 day', '1 day') day;
INSERT INTO fleet.probing (machine, at, output, displacement_um, measured_um, modelled_um, claimed_um)
  SELECT id, day, 'z_um', 20 + 1.5 * sin(id + extract(day FROM day)) + CASE WHEN name = '{odd}' THEN 9 ELSE 0 END, 2, 20, 2
  FROM fleet.machine, generate_series(now() - interval '300 days', now() - interval '1 hour', '1 day') day;
INSERT INTO fleet.event (machine, at, run, number, kind, what, record)
  SELECT id, now() - n * interval '2 hours', 1, 1000 - n, 'fault', 'outside of what its model was made from',
    json_build_object('kind', 'fault', 'name', CASE WHEN n < id % 28 THEN 'outside_domain' ELSE 'reading' END)
  FROM fleet.machine, generate_series(1, 360) n;
INSERT INTO fleet.minute (machine, setup, at, value)
  SELECT id, 1, at, ARRAY[22 + 4 * sin(extract(epoch FROM at) / 13751) + 0.3 * sin(id) +
      CASE WHEN name = '{odd}' THEN 5 ELSE 0 END, 21 + sin(extract(epoch FROM at) / 13751), 20.5 + 0.1 * sin(id), 6000, 12]
  FROM fleet.machine, generate_series(date_trunc('minute', now()) - interval '{minutes}', date_trunc('minute', now()) - interval '2 hours', '1 minute') at;
INSERT INTO fleet.sample (machine, setup, at, value)
  SELECT id, 1, at, ARRAY[22 + 4 * sin(extract(epoch FROM at) / 13751) + 0.3 * sin(id) +
      CASE WHEN name = '{odd}' THEN 5 ELSE 0 END, 21, 20.5, 6000, 12]
  FROM fleet.machine, generate_series(date_trunc('minute', now()) - interval '2 hours', now(), '10 s') at;
WITH made AS (INSERT INTO fleet.release (machine, model, note)
  SELECT id, encode(sha256('x'), 'hex'), 'colder head' FROM fleet.machine WHERE id % 3 = 0 RETURNING id)
INSERT INTO fleet.release_step (release, step, detail)
  SELECT id, step, CASE step WHEN 'candidate' THEN 'over ' || place || ' probings' ELSE '' END
  FROM made, unnest(ARRAY['offered', 'checked', 'candidate', 'candidate', 'promoted']) WITH ORDINALITY AS each (step, place);
ANALYZE;
"""


def fill(ask, minutes="1 day"):
    """@param ask  runs SQL as the store's owner"""
    ask(FILL.format(machines=MACHINES, odd=ODD, columns=",".join(COLUMNS), minutes=minutes))
