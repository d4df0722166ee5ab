-- Each output's newest probing is judged, that of a model without a claimed error, too.

-- Of a machine: of the newest probing of each output the one that is far off, else the newest, and what the model in
-- use left of it. Far off: beyond three times what the model claimed; where it claims nothing, more than half of the
-- displacement and three times the noise of a probing, 1 um where it was not given.
CREATE OR REPLACE VIEW fleet.last_probing WITH (security_invoker = true) AS
  SELECT machine.id AS machine, shown.at, shown.output, shown.remainder_um, shown.claimed_um, shown.is_far
  FROM fleet.machine CROSS JOIN LATERAL
    (SELECT newest.*, abs(remainder_um) >
       CASE WHEN claimed_um IS NULL THEN greatest(3 * coalesce(sd_um, 1), 0.5 * abs(displacement_um))
            ELSE 3 * claimed_um END AS is_far
     FROM (SELECT DISTINCT ON (output) at, output, displacement_um, displacement_um - modelled_um AS remainder_um,
             claimed_um, sd_um
           FROM fleet.probing WHERE probing.machine = machine.id ORDER BY output, at DESC) newest
     ORDER BY is_far DESC NULLS LAST, at DESC LIMIT 1) shown;

-- Of each machine one row. The rank is that of the last night's remainder among the machines of the type, 1 the smallest.
CREATE OR REPLACE FUNCTION fleet.page_machines() RETURNS json LANGUAGE sql STABLE AS $$
  WITH shown AS (
    SELECT state.id, state.name, state.type, state.hall, state.seen, state.newest, state.night, state.departs, state.probability, state.release,
      state.release_step, probing.at, probing.output, probing.remainder_um, probing.claimed_um, probing.is_far,
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
      WHEN is_far AND claimed_um IS NOT NULL THEN 'probed further off than claimed'
      WHEN is_far THEN 'the model gives less than half of what was probed'
      WHEN outside_days >= 3 THEN 'often outside of its model'
      WHEN newest IS NULL OR newest < now() - interval '1 day' THEN 'records nothing'
      WHEN departs IS NULL THEN 'not compared yet'
      WHEN night < current_date - 2 THEN 'not compared lately'
      ELSE 'as its sisters' END AS verdict
    FROM shown)
  SELECT coalesce(json_agg(json_build_object('name', name, 'type', type, 'hall', hall, 'verdict', verdict,
    'level', CASE WHEN verdict IN ('departs from its sisters') THEN 'bad'
                  WHEN verdict IN ('probed further off than claimed', 'often outside of its model',
                    'the model gives less than half of what was probed') THEN 'warning'
                  WHEN verdict = 'as its sisters' THEN 'good' ELSE 'unknown' END,
    'seen_s', extract(epoch FROM seen), 'probed_s', extract(epoch FROM at), 'output', output,
    'remainder_um', remainder_um, 'claimed_um', claimed_um, 'outside_days', outside_days, 'rank', rank,
    'ranked', ranked, 'release', release, 'release_step', release_step) ORDER BY name), '[]')
  FROM judged
$$;
