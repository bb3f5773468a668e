-- Parts and alarms are taken apart once, when they arrive, and kept in tables of their own beside the records: views that
-- did it for each row that is asked took seconds from 100,000 runs on. The functions that do it open a subtransaction,
-- which a plan with parallel workers must not.
CREATE OR REPLACE FUNCTION shop.value_of(data text) RETURNS jsonb LANGUAGE plpgsql IMMUTABLE STRICT PARALLEL UNSAFE AS $$
BEGIN
    RETURN data::jsonb;
EXCEPTION WHEN data_exception OR program_limit_exceeded THEN
    RETURN NULL;
END $$;
ALTER FUNCTION shop.moment_of(text) PARALLEL UNSAFE;

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

-- What a lathe sends meanwhile waits, and is then seen by the triggers.
LOCK TABLE shop.events, shop.measurements IN SHARE ROW EXCLUSIVE MODE;
SET LOCAL timezone = 'UTC';
CREATE TABLE shop.part_summaries AS SELECT * FROM shop.parts_of_records;
CREATE TABLE shop.alarm_summaries AS SELECT * FROM shop.alarms_of_records;
ALTER TABLE shop.part_summaries ADD PRIMARY KEY (lathe_id, run_id, part);
ALTER TABLE shop.alarm_summaries ADD PRIMARY KEY (lathe_id, run_id, number);
CREATE INDEX part_summaries_in_order ON shop.part_summaries (lathe_id, machine, job, arrival, number);
CREATE INDEX part_summaries_by_job ON shop.part_summaries (job, machine, lathe_id, arrival, number)
    INCLUDE (run_id, measured_at, ront_um, tolerance_um);  -- all that a run chart needs, in its order
CREATE INDEX alarm_summaries_in_order ON shop.alarm_summaries (lathe_id, source_row);
CREATE INDEX alarm_summaries_by_moment ON shop.alarm_summaries (raised_at);
CREATE INDEX runs_of_lathe ON shop.runs (lathe_id, arrival);
ANALYZE shop.part_summaries, shop.alarm_summaries;

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

CREATE OR REPLACE VIEW shop.parts AS
SELECT lathe_id, machine, job, row_number() OVER of_job AS place, run_id, part, at_utc, measured_at, operator, strategy, ront_um,
    tolerance_um, passed, diameter_mm, nominal_diameter_mm, diameter_tolerance_um, lobe_um_pp, chuck
FROM shop.part_summaries
WINDOW of_job AS (PARTITION BY lathe_id, machine, job ORDER BY arrival, number);

CREATE OR REPLACE VIEW shop.alarms AS
SELECT lathe_id, machine, job, operator, simulated, run_id, number, at_utc, raised_at, code, priority, key, value, source_row
FROM shop.alarm_summaries;
