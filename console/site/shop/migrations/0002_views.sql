-- What is asked of a shop. Order is that of the rows at the lathe; times are those of the lathe's clock, as text may be
-- no time: then they are NULL. Simulated runs are in no view but shop.alarms and shop.lathes, where they are marked.
CREATE FUNCTION shop.value_of(data text) RETURNS jsonb LANGUAGE plpgsql IMMUTABLE STRICT PARALLEL SAFE AS $$
BEGIN
    RETURN data::jsonb;
EXCEPTION WHEN data_exception THEN
    RETURN NULL;
END $$;

CREATE FUNCTION shop.moment_of(at_utc text) RETURNS timestamptz LANGUAGE plpgsql STABLE STRICT PARALLEL SAFE AS $$
BEGIN
    RETURN at_utc::timestamptz;
EXCEPTION WHEN data_exception THEN
    RETURN NULL;
END $$;

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

-- Measured products of real machines: the last measurement of each, in the order in which they were cut.
CREATE VIEW shop.parts AS
SELECT lathe_id, machine, job, row_number() OVER of_job AS place, run_id, part, at_utc, moment AS measured_at,
    operator, strategy, ront_um, limit_um AS tolerance_um, passed, diameter_mm, nominal_diameter_mm, diameter_tolerance_um,
    lobe_um_pp, chuck
FROM (
    SELECT DISTINCT ON (m.lathe_id, m.run_id, m.part) m.*, r.machine, r.job, r.operator, r.strategy,
        coalesce(m.tolerance_um, r.tolerance_um) AS limit_um,
        r.arrival, shop.moment_of(m.at_utc) AS moment, shop.value_of(r.setup) ->> 'clamped_at' AS chuck
    FROM shop.measurements AS m JOIN shop.runs AS r USING (lathe_id, run_id)
    WHERE m.product = 1 AND r.simulated = 0
    ORDER BY m.lathe_id, m.run_id, m.part, m.number DESC
) AS newest
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
SELECT e.lathe_id, r.machine, r.job, r.operator, r.simulated = 1 AS simulated, e.run_id, e.number, e.at_utc,
    shop.moment_of(e.at_utc) AS raised_at, e.value ->> 'code' AS code, e.value ->> 'priority' AS priority,
    e.value ->> 'key' AS key, e.value ->> 'value' AS value, e.source_row
FROM (SELECT *, shop.value_of(data) AS value FROM shop.events WHERE kind = 'alarm_raised') AS e
JOIN shop.runs AS r USING (lathe_id, run_id);

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
