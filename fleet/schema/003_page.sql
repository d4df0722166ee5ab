-- What the page shows, as JSON. The functions have the rights of who calls them: members of fleet_page read all.

CREATE INDEX event_outside ON fleet.event (machine, at) WHERE record->>'name' = 'outside_domain';

-- Of a machine: its last probing, and what the model in use left of it, against what it claimed.
CREATE VIEW fleet.last_probing WITH (security_invoker = true) AS
  SELECT machine.id AS machine, last.*
  FROM fleet.machine CROSS JOIN LATERAL
    (SELECT at, output, displacement_um - modelled_um AS remainder_um, claimed_um FROM fleet.probing
     WHERE probing.machine = machine.id ORDER BY at DESC LIMIT 1) last;

-- Of each machine one row. A remainder counts as large beyond three times what was claimed; the rank is that of
-- the last night's remainder among the machines of the type, 1 the smallest.
CREATE FUNCTION fleet.page_machines() RETURNS json LANGUAGE sql STABLE AS $$
  WITH shown AS (
    SELECT state.id, state.name, state.type, state.hall, state.seen, state.newest, state.night, state.departs, state.probability, state.release,
      state.release_step, probing.at, probing.output, probing.remainder_um, probing.claimed_um,
      (SELECT count(DISTINCT (event.at AT TIME ZONE 'UTC')::date) FROM fleet.event
       WHERE event.machine = state.id AND record->>'name' = 'outside_domain'
         AND event.at >= now() - interval '30 days') AS outside_days,
      CASE WHEN state.remainder_um IS NOT NULL THEN
        rank() OVER (PARTITION BY state.type, state.remainder_um IS NULL ORDER BY state.remainder_um) END AS rank,
      count(state.remainder_um) OVER (PARTITION BY state.type) AS ranked
    FROM fleet.machine_state state LEFT JOIN fleet.last_probing probing ON probing.machine = state.id),
  judged AS (
    SELECT shown.*, CASE
      WHEN seen IS NULL THEN 'has sent nothing yet'
      WHEN seen < now() - interval '1 hour' THEN 'silent'
      WHEN departs THEN 'departs from its sisters'
      WHEN abs(remainder_um) > 3 * claimed_um THEN 'probed further off than claimed'
      WHEN outside_days >= 3 THEN 'often outside of its model'
      WHEN newest IS NULL OR newest < now() - interval '1 day' THEN 'records nothing'
      WHEN departs IS NULL THEN 'not compared yet'
      WHEN night < current_date - 2 THEN 'not compared lately'
      ELSE 'as its sisters' END AS verdict
    FROM shown)
  SELECT coalesce(json_agg(json_build_object('name', name, 'type', type, 'hall', hall, 'verdict', verdict,
    'level', CASE WHEN verdict IN ('departs from its sisters') THEN 'bad'
                  WHEN verdict IN ('probed further off than claimed', 'often outside of its model') THEN 'warning'
                  WHEN verdict = 'as its sisters' THEN 'good' ELSE 'unknown' END,
    'seen_s', extract(epoch FROM seen), 'probed_s', extract(epoch FROM at), 'output', output,
    'remainder_um', remainder_um, 'claimed_um', claimed_um, 'outside_days', outside_days, 'rank', rank,
    'ranked', ranked, 'release', release, 'release_step', release_step) ORDER BY name), '[]')
  FROM judged
$$;

-- A machine's months, newest first, its columns, releases and newest events. NULL: there is no such machine.
CREATE FUNCTION fleet.page_machine(wanted text) RETURNS json LANGUAGE sql STABLE AS $$
  SELECT json_build_object('name', name, 'type', type, 'hall', hall, 'approval', approval,
    'columns', (SELECT to_json(columns) FROM fleet.setup WHERE machine = machine.id ORDER BY number DESC LIMIT 1),
    'night', (SELECT json_build_object('night', night, 'departs', departs, 'probability', probability,
                'departure', departure, 'diagnosis', diagnosis->'findings', 'error', error)
              FROM fleet.night_result WHERE machine = machine.id ORDER BY night DESC, finished DESC LIMIT 1),
    'months', (SELECT coalesce(json_agg(each), '[]') FROM
      (SELECT to_char(night, 'YYYY-MM') AS month, count(*) AS nights, count(*) FILTER (WHERE departs) AS departing,
         percentile_cont(0.5) WITHIN GROUP (ORDER BY remainder_um) AS remainder_um,
         percentile_cont(0.5) WITHIN GROUP (ORDER BY claimed_um) AS claimed_um
       FROM fleet.night_result WHERE machine = machine.id GROUP BY 1 ORDER BY 1 DESC LIMIT 13) each),
    'releases', (SELECT coalesce(json_agg(release), '[]') FROM
      (SELECT release.id, left(release.model, 12) AS model, release.note,
         (SELECT json_agg(json_build_object('step', step, 'who', who, 'at_s', extract(epoch FROM at),
            'detail', CASE WHEN step IN ('approved', 'rollback') THEN '' ELSE detail END) ORDER BY id)
          FROM fleet.release_step WHERE release = release.id) AS steps
       FROM fleet.release WHERE machine = machine.id ORDER BY id DESC LIMIT 10) release),
    'events', (SELECT coalesce(json_agg(event), '[]') FROM
      (SELECT extract(epoch FROM at) AS at_s, kind, what FROM fleet.event WHERE machine = machine.id
       ORDER BY at DESC LIMIT 40) event))
  FROM fleet.machine WHERE name = wanted
$$;

-- A column of a machine and of up to 20 of its sisters, those of its hall first: the first mean of each of `points`
-- equal spans, of a minute where there is one, else of 10 s. A look-up each, so that a year costs what a day does.
-- NULL: there is no such machine.
CREATE FUNCTION fleet.page_curves(wanted text, shown_column text, from_s float8, to_s float8, points integer)
RETURNS json LANGUAGE sql STABLE AS $$
  WITH own AS (SELECT * FROM fleet.machine WHERE name = wanted),
  shown AS (
    SELECT machine.id, machine.name FROM fleet.machine JOIN own USING (type)
    ORDER BY machine.id = own.id DESC, machine.hall = own.hall DESC, machine.name LIMIT 21),
  place AS (
    SELECT setup.machine, setup.number AS setup, array_position(columns, shown_column) AS place
    FROM fleet.setup JOIN shown ON shown.id = setup.machine WHERE shown_column = ANY (columns)),
  span AS (
    SELECT point, to_timestamp(from_s + point * (to_s - from_s) / points) AS begins,
      to_timestamp(from_s + (point + 1) * (to_s - from_s) / points) AS ends
    FROM generate_series(0, points - 1) point),
  curve AS (
    SELECT shown.name, json_agg(point ORDER BY point) AS at,
      json_agg(round(value[place]::numeric, 3) ORDER BY point) AS mean
    FROM shown CROSS JOIN span CROSS JOIN LATERAL
      ((SELECT setup, value FROM fleet.minute WHERE machine = shown.id AND at >= begins AND at < ends ORDER BY at LIMIT 1)
       UNION ALL
       (SELECT setup, value FROM fleet.sample WHERE machine = shown.id AND at >= begins AND at < ends ORDER BY at LIMIT 1)
       LIMIT 1) found
    JOIN place ON place.machine = shown.id AND place.setup = found.setup
    GROUP BY shown.name)
  SELECT json_build_object('from_s', from_s, 'step_s', (to_s - from_s) / points,
    'curves', coalesce((SELECT json_agg(curve ORDER BY curve.name = own.name, curve.name) FROM curve), '[]'))
  FROM own
$$;

REVOKE EXECUTE ON FUNCTION fleet.page_machines(), fleet.page_machine(text),
  fleet.page_curves(text, text, float8, float8, integer) FROM PUBLIC;
GRANT EXECUTE ON FUNCTION fleet.page_machines(), fleet.page_machine(text),
  fleet.page_curves(text, text, float8, float8, integer) TO fleet_page;
GRANT SELECT ON fleet.last_probing TO fleet_page;
