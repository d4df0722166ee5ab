-- What the night works with.

-- `through`: the last night that the series was made of.
DROP TABLE fleet.series;
CREATE TABLE fleet.series (
  id integer GENERATED ALWAYS AS IDENTITY PRIMARY KEY,
  type text NOT NULL,
  kind text NOT NULL CHECK (kind IN (
    'type',       -- all machines: fit --prior, for a new one
    'sisters',    -- all but this machine: whether it departs
    'own_past')), -- this machine alone
  machine integer REFERENCES fleet.machine CHECK ((machine IS NULL) = (kind = 'type')),
  through date NOT NULL,
  machines integer NOT NULL,
  program_version text NOT NULL,
  made timestamptz NOT NULL DEFAULT now(),
  content text NOT NULL,  -- SERIES.toml
  UNIQUE NULLS NOT DISTINCT (type, kind, machine, through)
);
GRANT SELECT ON fleet.series TO fleet_page, fleet_night;
GRANT INSERT ON fleet.series TO fleet_night;
ALTER TABLE fleet.series ENABLE ROW LEVEL SECURITY;
CREATE POLICY everything ON fleet.series FOR SELECT TO fleet_page, fleet_night USING (true);
CREATE POLICY night ON fleet.series FOR INSERT TO fleet_night WITH CHECK (true);

-- Minute means of a machine's night, from its samples.
CREATE FUNCTION fleet.make_minutes(of_machine integer, night date) RETURNS void LANGUAGE sql AS $$
  INSERT INTO fleet.minute (machine, setup, at, value)
  SELECT of_machine, setup, minute, array_agg(mean ORDER BY place)
  FROM (SELECT setup, date_trunc('minute', at) AS minute, place, avg(each)::real AS mean
        FROM fleet.sample, unnest(value) WITH ORDINALITY AS of_row (each, place)
        WHERE machine = of_machine AND at >= night::timestamp AT TIME ZONE 'UTC'
          AND at < (night + 1)::timestamp AT TIME ZONE 'UTC'
        GROUP BY setup, minute, place) AS means
  GROUP BY setup, minute
  ON CONFLICT DO NOTHING
$$;

-- Nights that are over and whose rows have all arrived, since `first`, without a result of this version.
CREATE FUNCTION fleet.open_nights(first date, version text)
RETURNS TABLE (machine integer, name text, type text, night date) LANGUAGE sql STABLE AS $$
  SELECT m.id, m.name, m.type, day::date
  FROM fleet.machine m
  JOIN (SELECT machine, max(newest) AS newest FROM fleet.uplink GROUP BY machine) u ON u.machine = m.id
  CROSS JOIN LATERAL generate_series(first::timestamp, (u.newest AT TIME ZONE 'UTC') - interval '1 day', '1 day') AS day
  WHERE NOT EXISTS (SELECT FROM fleet.night_result r WHERE r.machine = m.id AND r.night = day::date
                      AND r.program_version = version AND r.state <> 'failed')
    AND EXISTS (SELECT FROM fleet.sample s WHERE s.machine = m.id AND s.at >= day AT TIME ZONE 'UTC'
                  AND s.at < (day + interval '1 day') AT TIME ZONE 'UTC')
  ORDER BY day, m.type, m.name
$$;
