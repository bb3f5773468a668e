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
