-- What is recorded at the lathes, as it stands there: same columns, same texts. Rows are only added.
-- source_row is the number of the row at its lathe: the order in which it was written there, whatever the clocks say.
CREATE SCHEMA IF NOT EXISTS shop;

CREATE TABLE shop.contacts (
    lathe_id text NOT NULL, name text NOT NULL, software text NOT NULL,
    lathe_at timestamptz NOT NULL, received_at timestamptz NOT NULL DEFAULT clock_timestamp()
);
CREATE INDEX contacts_by_lathe ON shop.contacts (lathe_id, received_at DESC);

CREATE TABLE shop.progress (
    lathe_id text NOT NULL, file_id text NOT NULL, source_table text NOT NULL,
    last_row bigint NOT NULL DEFAULT 0, last_mark text NOT NULL DEFAULT '', again boolean NOT NULL DEFAULT false,
    updated_at timestamptz NOT NULL DEFAULT now(),
    PRIMARY KEY (lathe_id, file_id, source_table)
);

CREATE TABLE shop.texts (
    sha256 text PRIMARY KEY, content text NOT NULL,
    CONSTRAINT text_is_what_its_hash_says CHECK (sha256 = encode(sha256(convert_to(content, 'UTF8')), 'hex'))
);

CREATE TABLE shop.runs (
    lathe_id text NOT NULL, file_id text NOT NULL, source_row bigint NOT NULL,
    arrival bigint GENERATED ALWAYS AS IDENTITY, received_at timestamptz NOT NULL DEFAULT now(),
    run_id text NOT NULL, started_utc text NOT NULL, software text NOT NULL,
    job text NOT NULL, job_sha256 text NOT NULL, machine text NOT NULL, machine_sha256 text NOT NULL,
    simulated bigint NOT NULL, strategy text NOT NULL, program text NOT NULL,
    job_text_sha256 text REFERENCES shop.texts, machine_text_sha256 text REFERENCES shop.texts,
    python text, controller text, family text, stage text, compensation bigint, operator text,
    tolerance_um double precision, setup text,
    PRIMARY KEY (lathe_id, run_id)
);
-- Not unique: after a restored backup a number may be of two rows.
CREATE INDEX runs_in_order ON shop.runs (lathe_id, file_id, source_row);
CREATE INDEX runs_by_arrival ON shop.runs (arrival);
CREATE INDEX runs_by_job ON shop.runs (job, arrival);
CREATE INDEX runs_by_machine ON shop.runs (machine, arrival);
CREATE INDEX runs_by_start ON shop.runs (started_utc);
CREATE INDEX runs_by_id ON shop.runs (run_id text_pattern_ops);
CREATE INDEX runs_of_lathe ON shop.runs (lathe_id, arrival);

CREATE TABLE shop.events (
    lathe_id text NOT NULL, file_id text NOT NULL, source_row bigint NOT NULL,
    run_id text NOT NULL, number bigint NOT NULL, at_utc text NOT NULL, kind text NOT NULL, data text NOT NULL,
    PRIMARY KEY (lathe_id, run_id, number), FOREIGN KEY (lathe_id, run_id) REFERENCES shop.runs
);
CREATE INDEX events_by_kind ON shop.events (kind, lathe_id, run_id);

CREATE TABLE shop.measurements (
    lathe_id text NOT NULL, file_id text NOT NULL, source_row bigint NOT NULL,
    run_id text NOT NULL, number bigint NOT NULL, at_utc text NOT NULL, part text NOT NULL, product bigint NOT NULL,
    ront_um double precision NOT NULL, tolerance_um double precision, passed bigint, diameter_mm double precision,
    nominal_diameter_mm double precision, diameter_tolerance_um double precision, lobe_um_pp double precision,
    trace_sha256 text, trace_name text, data text NOT NULL,
    PRIMARY KEY (lathe_id, run_id, number), FOREIGN KEY (lathe_id, run_id) REFERENCES shop.runs
);

CREATE TABLE shop.traces (
    lathe_id text NOT NULL, file_id text NOT NULL, source_row bigint NOT NULL,
    run_id text NOT NULL, number bigint NOT NULL, content bytea NOT NULL,
    PRIMARY KEY (lathe_id, run_id, number), FOREIGN KEY (lathe_id, run_id) REFERENCES shop.runs
);
ALTER TABLE shop.traces ALTER COLUMN content SET STORAGE EXTERNAL;  -- compressed already

CREATE TABLE shop.telemetry (
    lathe_id text NOT NULL, file_id text NOT NULL, source_row bigint NOT NULL,
    run_id text NOT NULL, number bigint NOT NULL, part text NOT NULL, kind text NOT NULL, begun_utc text NOT NULL,
    data bytea NOT NULL,
    PRIMARY KEY (lathe_id, run_id, number), FOREIGN KEY (lathe_id, run_id) REFERENCES shop.runs
);

-- Times are those of the lathe's clock, as text may be no time: then they are NULL. Each opens a subtransaction, which a plan
-- with parallel workers must not.
CREATE FUNCTION shop.value_of(data text) RETURNS jsonb LANGUAGE plpgsql IMMUTABLE STRICT PARALLEL UNSAFE AS $$
BEGIN
    RETURN data::jsonb;
EXCEPTION WHEN data_exception OR program_limit_exceeded THEN
    RETURN NULL;
END $$;

CREATE FUNCTION shop.moment_of(at_utc text) RETURNS timestamptz LANGUAGE plpgsql STABLE STRICT PARALLEL UNSAFE AS $$
BEGIN
    RETURN at_utc::timestamptz;
EXCEPTION WHEN data_exception THEN
    RETURN NULL;
END $$;

-- Parts and alarms are taken apart once, when they arrive, and kept in tables of their own beside the records: views that
-- did it for each row that is asked took seconds from 100,000 runs on. Parts: measured products of real machines, the last
-- measurement of each.
CREATE VIEW shop.parts_of_records AS
SELECT DISTINCT ON (m.lathe_id, m.run_id, m.part) m.lathe_id, m.run_id, m.part, m.number, r.arrival, r.machine, r.job,
    m.at_utc, shop.moment_of(m.at_utc) AS measured_at, r.operator, r.strategy, m.ront_um,
    coalesce(m.tolerance_um, r.tolerance_um) AS tolerance_um, m.passed, m.diameter_mm, m.nominal_diameter_mm,
    m.diameter_tolerance_um, m.lobe_um_pp, shop.value_of(r.setup) ->> 'clamped_at' AS chuck
FROM shop.measurements AS m JOIN shop.runs AS r USING (lathe_id, run_id)
WHERE m.product = 1 AND r.simulated = 0
ORDER BY m.lathe_id, m.run_id, m.part, m.number DESC;

CREATE VIEW shop.alarms_of_records AS
SELECT e.lathe_id, e.run_id, e.number, e.source_row, r.machine, r.job, r.operator, r.simulated = 1 AS simulated, e.at_utc,
    shop.moment_of(e.at_utc) AS raised_at, e.value ->> 'code' AS code, e.value ->> 'priority' AS priority,
    e.value ->> 'key' AS key, e.value ->> 'value' AS value
FROM (SELECT *, shop.value_of(data) AS value FROM shop.events WHERE kind = 'alarm_raised') AS e
JOIN shop.runs AS r USING (lathe_id, run_id);

CREATE TABLE shop.part_summaries AS SELECT * FROM shop.parts_of_records;
CREATE TABLE shop.alarm_summaries AS SELECT * FROM shop.alarms_of_records;
ALTER TABLE shop.part_summaries ADD PRIMARY KEY (lathe_id, run_id, part);
ALTER TABLE shop.alarm_summaries ADD PRIMARY KEY (lathe_id, run_id, number);
CREATE INDEX part_summaries_in_order ON shop.part_summaries (lathe_id, machine, job, arrival, number);
CREATE INDEX part_summaries_by_job ON shop.part_summaries (job, machine, lathe_id, arrival, number)
    INCLUDE (run_id, measured_at, ront_um, tolerance_um);  -- all that a run chart needs, in its order
CREATE INDEX alarm_summaries_in_order ON shop.alarm_summaries (lathe_id, source_row);
CREATE INDEX alarm_summaries_by_moment ON shop.alarm_summaries (raised_at);

-- With the rights of the owner, as a lathe may add records and nothing else. They are made from all records of the runs
-- that rows were added to or deleted from: a part is measured again, a backup is gone over, old runs are removed. OFFSET 0 and
-- no other joins: each run is looked up by its key, however many there are.
CREATE FUNCTION shop.summarise_parts() RETURNS trigger LANGUAGE plpgsql SECURITY DEFINER
    SET search_path = pg_catalog SET timezone = 'UTC' SET enable_hashjoin = off SET enable_mergejoin = off AS $$
BEGIN
    DELETE FROM shop.part_summaries AS s USING changed AS c WHERE (s.lathe_id, s.run_id) = (c.lathe_id, c.run_id);
    INSERT INTO shop.part_summaries
    SELECT found.* FROM (SELECT DISTINCT lathe_id, run_id FROM changed) AS c CROSS JOIN LATERAL
        (SELECT * FROM shop.parts_of_records AS p WHERE (p.lathe_id, p.run_id) = (c.lathe_id, c.run_id) OFFSET 0)
        AS found;
    RETURN NULL;
END $$;
CREATE TRIGGER parts_added AFTER INSERT ON shop.measurements REFERENCING NEW TABLE AS changed
    FOR EACH STATEMENT EXECUTE FUNCTION shop.summarise_parts();
CREATE TRIGGER parts_deleted AFTER DELETE ON shop.measurements REFERENCING OLD TABLE AS changed
    FOR EACH STATEMENT EXECUTE FUNCTION shop.summarise_parts();

CREATE FUNCTION shop.summarise_alarms() RETURNS trigger LANGUAGE plpgsql SECURITY DEFINER
    SET search_path = pg_catalog SET timezone = 'UTC' SET enable_hashjoin = off SET enable_mergejoin = off AS $$
BEGIN
    DELETE FROM shop.alarm_summaries AS s USING changed AS c
    WHERE c.kind = 'alarm_raised' AND (s.lathe_id, s.run_id, s.number) = (c.lathe_id, c.run_id, c.number);
    INSERT INTO shop.alarm_summaries
    SELECT found.* FROM changed AS c CROSS JOIN LATERAL (
        SELECT * FROM shop.alarms_of_records AS a WHERE (a.lathe_id, a.run_id, a.number) = (c.lathe_id, c.run_id, c.number)
        OFFSET 0
    ) AS found WHERE c.kind = 'alarm_raised';
    RETURN NULL;
END $$;
CREATE TRIGGER alarms_added AFTER INSERT ON shop.events REFERENCING NEW TABLE AS changed
    FOR EACH STATEMENT EXECUTE FUNCTION shop.summarise_alarms();
CREATE TRIGGER alarms_deleted AFTER DELETE ON shop.events REFERENCING OLD TABLE AS changed
    FOR EACH STATEMENT EXECUTE FUNCTION shop.summarise_alarms();

-- What is asked of a shop. Order is that of the rows at the lathe. Simulated runs are in no view but shop.alarms and
-- shop.lathes, where they are marked.

-- Each lathe that has sent anything: its newest name, when it was last heard of, how far its clock was ahead then.
CREATE VIEW shop.lathes AS
SELECT lathe_id, name, software, received_at AS last_contact,
    round(extract(epoch FROM lathe_at - received_at)::numeric, 1) AS clock_ahead_s,
    abs(extract(epoch FROM lathe_at - received_at)) > 600 AS clock_wrong, runs, last_sent
FROM (
    SELECT lathe_id, sum(last_row) FILTER (WHERE source_table = 'runs')::bigint AS runs, max(updated_at) AS last_sent
    FROM shop.progress GROUP BY lathe_id
) AS sent
CROSS JOIN LATERAL (
    SELECT name, software, lathe_at, received_at FROM shop.contacts
    WHERE contacts.lathe_id = sent.lathe_id ORDER BY received_at DESC LIMIT 1
) AS newest;

-- Measured products of real machines, in the order in which they were cut.
CREATE VIEW shop.parts AS
SELECT lathe_id, machine, job, row_number() OVER of_job AS place, run_id, part, at_utc, measured_at, operator, strategy, ront_um,
    tolerance_um, passed, diameter_mm, nominal_diameter_mm, diameter_tolerance_um, lobe_um_pp, chuck
FROM shop.part_summaries
WINDOW of_job AS (PARTITION BY lathe_id, machine, job ORDER BY arrival, number);

-- Individuals chart of roundness: mean and limits, mean +- 3 / 1.128 mean moving ranges, from eight parts on.
CREATE VIEW shop.run_chart AS
SELECT lathe_id, machine, job, place, measured_at, run_id, ront_um, tolerance_um, mean_um,
    mean_um - reach_um AS lower_um, mean_um + reach_um AS upper_um, abs(ront_um - mean_um) > reach_um AS beyond
FROM (
    SELECT *, avg(ront_um) OVER of_job AS mean_um,
        CASE WHEN count(*) OVER of_job >= 8 THEN 3 / 1.128 * avg(moving_um) OVER of_job END AS reach_um
    FROM (
        SELECT *, abs(ront_um - lag(ront_um) OVER (PARTITION BY lathe_id, machine, job ORDER BY place)) AS moving_um
        FROM shop.parts
    ) AS ranged
    WINDOW of_job AS (PARTITION BY lathe_id, machine, job)
) AS charted;

-- Capability by job and machine with the overall standard deviation; nothing is claimed below 30 parts. Roundness has an
-- upper limit only. Parts with different limits are apart.
CREATE VIEW shop.roundness_capability AS
SELECT lathe_id, machine, job, tolerance_um, count(*) AS parts, avg(ront_um) AS mean_um,
    stddev_samp(ront_um) AS sd_um, count(*) FILTER (WHERE passed = 0) AS failed,
    CASE WHEN count(*) >= 30 THEN (tolerance_um - avg(ront_um)) / nullif(3 * stddev_samp(ront_um), 0) END AS cpk
FROM shop.parts WHERE tolerance_um IS NOT NULL GROUP BY lathe_id, machine, job, tolerance_um;

CREATE VIEW shop.diameter_capability AS
SELECT lathe_id, machine, job, nominal_diameter_mm, diameter_tolerance_um, count(*) AS parts,
    avg(off_um) AS mean_off_um, stddev_samp(off_um) AS sd_um,
    CASE WHEN count(*) >= 30 THEN diameter_tolerance_um / nullif(3 * stddev_samp(off_um), 0) END AS cp,
    CASE WHEN count(*) >= 30 THEN (diameter_tolerance_um - abs(avg(off_um))) / nullif(3 * stddev_samp(off_um), 0)
    END AS cpk
FROM (SELECT *, 1000 * (diameter_mm - nominal_diameter_mm) AS off_um FROM shop.parts) AS judged
WHERE off_um IS NOT NULL AND diameter_tolerance_um IS NOT NULL
GROUP BY lathe_id, machine, job, nominal_diameter_mm, diameter_tolerance_um;

-- Alarms as they were raised.
CREATE VIEW shop.alarms AS
SELECT lathe_id, machine, job, operator, simulated, run_id, number, at_utc, raised_at, code, priority, key, value, source_row
FROM shop.alarm_summaries;

-- The lobe left on the parts of a job, clamping after clamping. A part whose clamping was not recorded is in none.
CREATE VIEW shop.lobe_drift AS
SELECT lathe_id, machine, job, row_number() OVER (PARTITION BY lathe_id, machine, job ORDER BY first_place) AS clamping,
    chuck AS clamped_at, parts, mean_lobe_um_pp, least_lobe_um_pp, most_lobe_um_pp,
    mean_lobe_um_pp - first_value(mean_lobe_um_pp)
        OVER (PARTITION BY lathe_id, machine, job ORDER BY first_place) AS drift_um_pp
FROM (
    SELECT lathe_id, machine, job, chuck, min(place) AS first_place, count(*) AS parts,
        avg(lobe_um_pp) AS mean_lobe_um_pp, min(lobe_um_pp) AS least_lobe_um_pp, max(lobe_um_pp) AS most_lobe_um_pp
    FROM shop.parts WHERE lobe_um_pp IS NOT NULL AND chuck IS NOT NULL GROUP BY lathe_id, machine, job, chuck
) AS clamped;
