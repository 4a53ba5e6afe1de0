-- Jobs in the queue, what happened to them, and the assets they make. Times are milliseconds since 1970, UTC.

CREATE TABLE jobs (
  id               INTEGER PRIMARY KEY AUTOINCREMENT,
  asset            TEXT NOT NULL,
  kind             TEXT NOT NULL,              -- 'material', 'brdf'
  out              TEXT NOT NULL,              -- containers go to <out>/<asset>
  origin           INTEGER NOT NULL,           -- 1 api, 2 watch
  -- 1 queued, 2 running, 3 succeeded, 4 failed, 5 cancelled, 6 retry_waiting, 7 buried
  state            INTEGER NOT NULL CHECK (state BETWEEN 1 AND 7),
  priority         INTEGER NOT NULL,
  threads          INTEGER NOT NULL,
  memory_mb        INTEGER NOT NULL,           -- 0 is no limit, here and in the next two
  cpu_s            INTEGER NOT NULL,
  wall_s           INTEGER NOT NULL,
  force            INTEGER NOT NULL,           -- bake even if nothing changed
  held             INTEGER NOT NULL DEFAULT 0,
  cancel_requested INTEGER NOT NULL DEFAULT 0,
  attempt          INTEGER NOT NULL DEFAULT 0, -- the fencing token: only this attempt may report
  failures         INTEGER NOT NULL DEFAULT 0, -- attempts lost to the machine
  created_ms       INTEGER NOT NULL,
  updated_ms       INTEGER NOT NULL,
  started_ms       INTEGER NOT NULL DEFAULT 0,
  finished_ms      INTEGER NOT NULL DEFAULT 0,
  due_ms           INTEGER NOT NULL DEFAULT 0,
  lease_ms         INTEGER NOT NULL DEFAULT 0,
  handle           TEXT NOT NULL DEFAULT '',   -- how the executor finds the running attempt again
  base_revision    TEXT NOT NULL DEFAULT '',   -- `current` before the first attempt
  error_code       TEXT NOT NULL DEFAULT '',
  error_message    TEXT NOT NULL DEFAULT '',
  revision         TEXT NOT NULL DEFAULT '',
  container        TEXT NOT NULL DEFAULT '',
  signature        TEXT NOT NULL DEFAULT '',   -- of the source, for jobs of the watcher
  idempotency_key  TEXT UNIQUE,
  request_sha256   TEXT NOT NULL,              -- what the key was used for
  job              TEXT NOT NULL,              -- the job file
  result           TEXT NOT NULL DEFAULT ''    -- result.json of the last attempt
) STRICT;

CREATE INDEX jobs_by_state ON jobs (state, id);
CREATE INDEX jobs_by_asset ON jobs (out, asset, state);
CREATE INDEX jobs_to_run ON jobs (priority DESC, id) WHERE state = 1 AND held = 0;
CREATE INDEX jobs_due ON jobs (due_ms) WHERE state = 6;

CREATE TABLE events (
  id      INTEGER PRIMARY KEY AUTOINCREMENT,
  time_ms INTEGER NOT NULL,
  job     INTEGER NOT NULL, -- 0: of the queue
  type    TEXT NOT NULL,
  data    TEXT NOT NULL     -- a JSON object
) STRICT;

CREATE TABLE assets (
  out         TEXT NOT NULL,
  name        TEXT NOT NULL,
  source      TEXT NOT NULL,
  signature   TEXT NOT NULL,
  failed_file TEXT NOT NULL,
  last_job    INTEGER NOT NULL,
  updated_ms  INTEGER NOT NULL,
  gone        INTEGER NOT NULL,
  PRIMARY KEY (name, out)
) STRICT, WITHOUT ROWID;

CREATE TABLE settings (
  name  TEXT PRIMARY KEY,
  value TEXT NOT NULL
) STRICT, WITHOUT ROWID;
