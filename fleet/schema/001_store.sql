-- The store of a series of machines: what their uplinks send, what the night finds, what is released.
-- Run once by `thermocomp-fleet init`, in one transaction, as the owner of the database, who may create roles.
-- A later change is a file of its own, 002_NAME.sql: a migration that was applied is not edited.

CREATE SCHEMA fleet;

-- Who may do what. A person is a role that logs in and is a member: GRANT fleet_approval TO maria;
-- Roles belong to the whole server, so another store beside this one may have made them.
DO $$
DECLARE
  name text;
BEGIN
  FOREACH name IN ARRAY ARRAY['fleet_machine',   -- an uplink: its own rows, its own releases
                              'fleet_page',      -- reads everything
                              'fleet_night',     -- reads everything, writes results
                              'fleet_release',   -- offers models, takes them back
                              'fleet_approval']  -- approves them centrally
  LOOP
    IF NOT EXISTS (SELECT FROM pg_roles WHERE rolname = name) THEN
      EXECUTE format('CREATE ROLE %I NOLOGIN', name);
    END IF;
  END LOOP;
  EXECUTE format('REVOKE ALL ON DATABASE %I FROM PUBLIC', current_database());
  EXECUTE format('GRANT CONNECT ON DATABASE %I TO fleet_machine, fleet_page, fleet_night, fleet_release, '
                 'fleet_approval', current_database());
END
$$;
GRANT USAGE ON SCHEMA fleet TO fleet_machine, fleet_page, fleet_night, fleet_release, fleet_approval;

-- ------------------------------------------------------------------------------------------ machines

CREATE TABLE fleet.machine (
  id integer GENERATED ALWAYS AS IDENTITY PRIMARY KEY,
  name text NOT NULL UNIQUE CHECK (name ~ '^[A-Za-z0-9_.-]{1,48}$'),
  role name NOT NULL UNIQUE GENERATED ALWAYS AS (('machine_' || name)::name) STORED,
  type text NOT NULL CHECK (type <> ''),
  hall text NOT NULL DEFAULT '',
  -- who says yes to a model: an operator beside the machine, or a member of fleet_approval
  approval text NOT NULL DEFAULT 'machine' CHECK (approval IN ('machine', 'central')),
  added timestamptz NOT NULL DEFAULT now()
);

-- The machine whose uplink asks; none for everybody else.
CREATE FUNCTION fleet.my_machine() RETURNS integer LANGUAGE sql STABLE AS
  'SELECT id FROM fleet.machine WHERE role = session_user';

-- Texts by their checksum: configurations and models as the daemon reads them.
CREATE TABLE fleet.document (
  checksum text PRIMARY KEY CHECK (checksum = encode(sha256(convert_to(content, 'UTF8')), 'hex')),
  kind text NOT NULL CHECK (kind IN ('configuration', 'model')),
  content text NOT NULL CHECK (octet_length(content) <= 16777216)
);

-- What a machine ran with: the meaning of its rows' values.
CREATE TABLE fleet.setup (
  machine integer NOT NULL REFERENCES fleet.machine,
  number integer NOT NULL,
  configuration text NOT NULL REFERENCES fleet.document,
  model text NOT NULL REFERENCES fleet.document,
  columns text[] NOT NULL CHECK (cardinality(columns) BETWEEN 1 AND 500),  -- of a run file, with units
  program_version text NOT NULL,
  since timestamptz NOT NULL DEFAULT now(),
  PRIMARY KEY (machine, number),
  UNIQUE (machine, configuration, model, program_version)
);

-- --------------------------------------------------------------------------------------- what is sent

-- A row of another time has come from a clock that was wrong: it is refused.
CREATE FUNCTION fleet.oldest_time() RETURNS timestamptz LANGUAGE sql STABLE AS
  $$SELECT date_trunc('month', now() - interval '12 months')$$;
CREATE FUNCTION fleet.newest_time() RETURNS timestamptz LANGUAGE sql STABLE AS
  $$SELECT now() + interval '1 hour'$$;
CREATE FUNCTION fleet.is_sound_time(at timestamptz) RETURNS boolean LANGUAGE sql STABLE AS
  $$SELECT at >= fleet.oldest_time() AND at <= fleet.newest_time()$$;

-- Means of 10 s. `at` is the beginning; a value that was missing is NULL.
CREATE TABLE fleet.sample (
  machine integer NOT NULL,
  setup integer NOT NULL,
  at timestamptz NOT NULL,
  value real[] NOT NULL,
  PRIMARY KEY (machine, at, setup)
) PARTITION BY RANGE (at);

-- The same of a minute; kept when samples are dropped.
CREATE TABLE fleet.minute (
  machine integer NOT NULL,
  setup integer NOT NULL,
  at timestamptz NOT NULL,
  value real[] NOT NULL,
  PRIMARY KEY (machine, at, setup)
) PARTITION BY RANGE (at);

-- Partitions from the oldest month that is taken to the month after next. Harmless when they exist.
CREATE FUNCTION fleet.make_partitions() RETURNS void LANGUAGE plpgsql AS $$
DECLARE
  month date;
  kept text;
BEGIN
  FOR month IN SELECT generate_series(fleet.oldest_time(), now() + interval '2 months', '1 month') LOOP
    FOREACH kept IN ARRAY ARRAY['sample', 'minute'] LOOP
      EXECUTE format('CREATE TABLE IF NOT EXISTS fleet.%I PARTITION OF fleet.%I FOR VALUES FROM (%L) TO (%L)',
                     kept || to_char(month, '_YYYY_MM'), kept, month, (month + interval '1 month')::date);
    END LOOP;
  END LOOP;
END
$$;
SET LOCAL timezone = 'UTC';
SELECT fleet.make_partitions();

CREATE TABLE fleet.event (
  machine integer NOT NULL REFERENCES fleet.machine,
  at timestamptz NOT NULL,
  run bigint NOT NULL,      -- one number for each start of the daemon
  number bigint NOT NULL,   -- counts up in a run
  kind text NOT NULL,
  what text NOT NULL,       -- for people
  record jsonb NOT NULL,    -- as the status socket gives it
  PRIMARY KEY (machine, at, run, number)
);

-- What was measured at the tool.
CREATE TABLE fleet.probing (
  machine integer NOT NULL REFERENCES fleet.machine,
  at timestamptz NOT NULL,
  output text NOT NULL,             -- of the model: z_um
  number smallint NOT NULL DEFAULT 0,  -- of several at once
  displacement_um real NOT NULL,    -- without the offset in effect
  measured_um real NOT NULL,        -- as it was given
  modelled_um real,                 -- what the model in use said, without what was learned from probings
  claimed_um real,                  -- the standard deviation that it stated
  sd_um real,                       -- standard deviation of the measurement, where it was given
  source text NOT NULL DEFAULT 'probe',
  PRIMARY KEY (machine, at, output, number)
);

-- How far the uplink has come, written with the rows in one transaction.
CREATE TABLE fleet.uplink (
  machine integer NOT NULL REFERENCES fleet.machine,
  history text NOT NULL,                   -- the file's name at the machine
  segment bigint NOT NULL DEFAULT 0,       -- what follows this cycle is still to be sent
  segment_wall_ns bigint NOT NULL DEFAULT 0,
  cycle bigint NOT NULL DEFAULT 0,
  event_run bigint NOT NULL DEFAULT 0,
  event_number bigint NOT NULL DEFAULT 0,
  newest timestamptz,                      -- end of what was sent
  sent bigint NOT NULL DEFAULT 0,          -- rows of samples: taken, refused and repeated
  refused bigint NOT NULL DEFAULT 0,       -- of an impossible time, from a clock that was wrong
  repeated bigint NOT NULL DEFAULT 0,      -- of a time that was there already
  damaged bigint NOT NULL DEFAULT 0,       -- parts of the history that could not be read
  seen timestamptz NOT NULL DEFAULT now(),
  program_version text NOT NULL DEFAULT '',
  PRIMARY KEY (machine, history)
);

-- ------------------------------------------------------------------------------------------ the night

CREATE TABLE fleet.series (
  type text NOT NULL,
  made timestamptz NOT NULL DEFAULT now(),
  program_version text NOT NULL,
  machines integer NOT NULL,
  content text NOT NULL,  -- SERIES.toml
  PRIMARY KEY (type, made)
);

-- A night is the day that ended: 24 h from 0:00 UTC.
CREATE TABLE fleet.night_result (
  machine integer NOT NULL REFERENCES fleet.machine,
  night date NOT NULL,
  model text NOT NULL,
  program_version text NOT NULL,
  state text NOT NULL CHECK (state IN ('done', 'empty', 'failed')),  -- empty: nothing was probed
  statistics text,         -- of `series --machine`
  departs boolean,         -- NULL: there is no series to compare with yet
  probability real,        -- of such a distance, or a larger one, in a machine of the series
  remainder_um real,       -- RMS of measured less what the model in use said
  claimed_um real,         -- what it claimed
  departure jsonb,         -- of `inspect --series --json`
  diagnosis jsonb,         -- of `diagnose --json`, of those that depart
  error text,
  took_s real,
  finished timestamptz NOT NULL DEFAULT now(),
  PRIMARY KEY (machine, night, model, program_version)
);

-- ------------------------------------------------------------------------------------------- releases

CREATE TABLE fleet.release (
  id bigint GENERATED ALWAYS AS IDENTITY PRIMARY KEY,
  machine integer NOT NULL REFERENCES fleet.machine,
  model text NOT NULL REFERENCES fleet.document,
  note text NOT NULL DEFAULT '',
  offered_by name NOT NULL DEFAULT session_user,
  offered_at timestamptz NOT NULL DEFAULT now()
);

-- What became of it: rows are added, none is changed.
CREATE TABLE fleet.release_step (
  id bigint GENERATED ALWAYS AS IDENTITY PRIMARY KEY,
  release bigint NOT NULL REFERENCES fleet.release,
  at timestamptz NOT NULL DEFAULT clock_timestamp(),
  step text NOT NULL CHECK (step IN (
    'offered', 'withdrawn', 'rollback',                -- fleet_release; rollback: fleet_approval too
    'approved',                                        -- fleet_approval, where the machine is approved centrally
    'checked', 'refused', 'candidate', 'approved_at_machine', 'promoted', 'rolled_back')),  -- the machine
  who name NOT NULL DEFAULT session_user,
  detail text NOT NULL DEFAULT ''
);
CREATE INDEX release_of_machine ON fleet.release (machine, id);
CREATE INDEX step_of_release ON fleet.release_step (release, id);

CREATE VIEW fleet.release_state WITH (security_invoker = true) AS
  SELECT release.*, last.step, last.at, last.who, last.detail
  FROM fleet.release CROSS JOIN LATERAL
    (SELECT step, at, who, detail FROM fleet.release_step WHERE release = release.id ORDER BY id DESC LIMIT 1) last;

-- A machine in one row: its uplink, its newest night, its newest release.
CREATE VIEW fleet.machine_state WITH (security_invoker = true) AS
  SELECT machine.*, uplink.seen, uplink.newest, uplink.sent, uplink.refused, uplink.repeated, uplink.damaged,
    night.night, night.state AS night_state, night.departs, night.probability, night.remainder_um,
    night.claimed_um, night.error, state.id AS release, state.model AS release_model, state.step AS release_step
  FROM fleet.machine
  LEFT JOIN LATERAL
    (SELECT max(seen) AS seen, max(newest) AS newest, sum(sent) AS sent, sum(refused) AS refused,
       sum(repeated) AS repeated, sum(damaged) AS damaged FROM fleet.uplink WHERE machine = machine.id) uplink ON true
  LEFT JOIN LATERAL
    (SELECT * FROM fleet.night_result WHERE machine = machine.id ORDER BY night DESC, finished DESC LIMIT 1) night ON true
  LEFT JOIN LATERAL
    (SELECT * FROM fleet.release_state WHERE machine = machine.id ORDER BY id DESC LIMIT 1) state ON true;

-- --------------------------------------------------------------------------------------- who may what

GRANT SELECT ON ALL TABLES IN SCHEMA fleet TO fleet_page, fleet_night;
GRANT INSERT, UPDATE ON fleet.night_result, fleet.series TO fleet_night;
GRANT INSERT ON fleet.minute TO fleet_night;
GRANT SELECT ON fleet.machine, fleet.document, fleet.release, fleet.release_step, fleet.release_state
  TO fleet_release, fleet_approval;
GRANT INSERT ON fleet.document, fleet.release, fleet.release_step TO fleet_release;
GRANT INSERT ON fleet.release_step TO fleet_approval;

GRANT INSERT ON fleet.document, fleet.setup, fleet.sample, fleet.event, fleet.probing, fleet.uplink,
  fleet.release_step TO fleet_machine;
GRANT SELECT ON fleet.machine, fleet.document, fleet.setup, fleet.uplink, fleet.release, fleet.release_step,
  fleet.release_state TO fleet_machine;
GRANT UPDATE ON fleet.uplink TO fleet_machine;

-- A machine sees and adds what is its own. Its partitions cannot be reached but through their table.
DO $$
DECLARE
  kept text;
BEGIN
  FOREACH kept IN ARRAY ARRAY['machine', 'document', 'setup', 'sample', 'minute', 'event', 'probing', 'uplink',
                              'night_result', 'series', 'release', 'release_step']
  LOOP
    EXECUTE format('ALTER TABLE fleet.%I ENABLE ROW LEVEL SECURITY', kept);
    EXECUTE format('CREATE POLICY everything ON fleet.%I FOR SELECT '
                   'TO fleet_page, fleet_night, fleet_release, fleet_approval USING (true)', kept);
  END LOOP;
END
$$;
CREATE POLICY night ON fleet.night_result TO fleet_night USING (true) WITH CHECK (true);
CREATE POLICY night ON fleet.series TO fleet_night USING (true) WITH CHECK (true);
CREATE POLICY night ON fleet.minute FOR INSERT TO fleet_night WITH CHECK (true);

CREATE POLICY own ON fleet.machine FOR SELECT TO fleet_machine USING (role = session_user);
CREATE POLICY add ON fleet.document FOR INSERT TO fleet_machine, fleet_release WITH CHECK (true);
CREATE POLICY own ON fleet.setup TO fleet_machine USING (machine = (SELECT fleet.my_machine()))
  WITH CHECK (machine = (SELECT fleet.my_machine()));
CREATE POLICY own ON fleet.sample FOR INSERT TO fleet_machine
  WITH CHECK (machine = (SELECT fleet.my_machine()) AND fleet.is_sound_time(at));
CREATE POLICY own ON fleet.event FOR INSERT TO fleet_machine
  WITH CHECK (machine = (SELECT fleet.my_machine()) AND fleet.is_sound_time(at));
CREATE POLICY own ON fleet.probing FOR INSERT TO fleet_machine
  WITH CHECK (machine = (SELECT fleet.my_machine()) AND fleet.is_sound_time(at));
CREATE POLICY own ON fleet.uplink TO fleet_machine USING (machine = (SELECT fleet.my_machine()))
  WITH CHECK (machine = (SELECT fleet.my_machine()));

CREATE POLICY own ON fleet.release FOR SELECT TO fleet_machine USING (machine = (SELECT fleet.my_machine()));
CREATE POLICY released ON fleet.document FOR SELECT TO fleet_machine
  USING (checksum IN (SELECT model FROM fleet.release));
CREATE POLICY own ON fleet.release_step FOR SELECT TO fleet_machine
  USING (release IN (SELECT id FROM fleet.release));
CREATE POLICY machine_step ON fleet.release_step FOR INSERT TO fleet_machine
  WITH CHECK (who = session_user AND release IN (SELECT id FROM fleet.release) AND
              (step IN ('checked', 'refused', 'candidate', 'promoted', 'rolled_back') OR
               (step = 'approved_at_machine' AND EXISTS (SELECT FROM fleet.machine WHERE approval = 'machine'))));
CREATE POLICY offer ON fleet.release FOR INSERT TO fleet_release WITH CHECK (offered_by = session_user);
CREATE POLICY offer_step ON fleet.release_step FOR INSERT TO fleet_release
  WITH CHECK (who = session_user AND step IN ('offered', 'withdrawn', 'rollback'));
CREATE POLICY approval_step ON fleet.release_step FOR INSERT TO fleet_approval
  WITH CHECK (who = session_user AND
              (step = 'rollback' OR
               (step = 'approved' AND EXISTS (SELECT FROM fleet.release JOIN fleet.machine ON machine.id = release.machine
                                              WHERE release.id = release_step.release AND approval = 'central'))));
