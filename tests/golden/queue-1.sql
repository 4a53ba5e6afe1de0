-- A queue as patinad of 7773685 left it; see README.md.
PRAGMA foreign_keys=OFF;
BEGIN TRANSACTION;
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
INSERT INTO jobs VALUES(1,'wall','material','/srv/patina/baked',2,3,0,2,0,0,0,0,0,0,1,0,1795391373161,1795391375158,1795391373170,1795391375158,0,0,'','','','','r0001','/srv/patina/baked/wall/r0001','f3387ba8638801a3565c815d3305dbc2ad3ffd30b93a43bd680b45b2bcaa0f0a',NULL,'c5b8ad0e59b4e857045780bf26eda8878d5cb13b10f1eda18e36016334c5ea06',replace('{\n  "version": 1,\n  "kind": "material",\n  "asset": "wall",\n  "folder": "/srv/patina/drop/wall",\n  "out": "/srv/patina/baked"\n}\n','\n',char(10)),replace('{\n  "version": 1,\n  "status": "done",\n  "exit_code": 0,\n  "asset": "wall",\n  "container": "/srv/patina/baked/wall/r0001",\n  "revision": "r0001",\n  "fingerprint": "ae6dabe44f45ee5a4202db98ab7ffe88b3ddce6473d09254760243c5ee6c4cab",\n  "profile": "bcf-1k",\n  "quality": "standard",\n  "recipe": "patina",\n  "seed": 1,\n  "seconds": 1.133556651,\n  "cpu_seconds": 0.420477931,\n  "samples": 4082544.0,\n  "stopped_by": "budget",\n  "bytes": 2368,\n  "psnr": {\n    "overall": 25.3523525527067,\n    "mip0": 20.687938057127493,\n    "mean_mips": 29.68053987349734,\n    "maps": {\n      "albedo": 24.440317188491605,\n      "normal": 31.848790183691285,\n      "ao": 19.895864770938452,\n      "roughness": 24.142828332597336,\n      "metalness": 24.633146882265528,\n      "displacement": 27.015501897760096,\n      "emissive": 27.26591835591001\n    }\n  },\n  "ssim": 0.642766069928723,\n  "flip": 0.21945262391091092,\n  "normal_angle_deg": 6.9773626099039125,\n  "warnings": []\n}\n','\n',char(10)));
INSERT INTO jobs VALUES(2,'broken','material','/srv/patina/baked',2,4,0,2,0,0,0,0,0,0,1,0,1795391377679,1795391378753,1795391377685,1795391378753,0,0,'','','corrupt_data','/srv/patina/drop/broken/broken_albedo.png: this png file is truncated or damaged (Read error: hit end of file; PNG read error: IDAT: Read error: hit end of file; PNG library error); replace it by an intact copy','','','a9a1bf003232ef4824caad75662a04618d8bf46fba842ecc4c1ae0293e6287c5',NULL,'c7d97ad749328c803a8de935f12a8a5af0e921d7e6387b6f50c05424a012f900',replace('{\n  "version": 1,\n  "kind": "material",\n  "asset": "broken",\n  "folder": "/srv/patina/drop/broken",\n  "out": "/srv/patina/baked"\n}\n','\n',char(10)),replace('{\n  "version": 1,\n  "status": "failed",\n  "exit_code": 3,\n  "error": {\n    "code": "corrupt_data",\n    "message": "/srv/patina/drop/broken/broken_albedo.png: this png file is truncated or damaged (Read error: hit end of file; PNG read error: IDAT: Read error: hit end of file; PNG library error); replace it by an intact copy",\n    "stage": "reference"\n  },\n  "asset": "broken",\n  "profile": "bcf-1k",\n  "quality": "standard",\n  "recipe": "patina",\n  "seed": 1,\n  "seconds": 0.025177918,\n  "cpu_seconds": 0.005109213999999973,\n  "warnings": []\n}\n','\n',char(10)));
INSERT INTO jobs VALUES(3,'later','material','/srv/patina/baked',2,1,0,2,0,0,0,0,0,0,0,0,1795391392339,1795391392339,0,0,0,0,'','','','','','','e4813dbbf6b64f178c29a441e6d50da0b9c782d273914b2073af73153710abe4',NULL,'328efc2bac097dc083a4c06bcd41d4d9872dcd181b2fd8f8de0feca8f68ebd20',replace('{\n  "version": 1,\n  "kind": "material",\n  "asset": "later",\n  "folder": "/srv/patina/drop/later",\n  "out": "/srv/patina/baked"\n}\n','\n',char(10)),'');
CREATE TABLE events (
  id      INTEGER PRIMARY KEY AUTOINCREMENT,
  time_ms INTEGER NOT NULL,
  job     INTEGER NOT NULL, -- 0: of the queue
  type    TEXT NOT NULL,
  data    TEXT NOT NULL     -- a JSON object
) STRICT;
INSERT INTO events VALUES(1,1795391373161,1,'submitted','{"asset":"wall","state":"queued","attempt":0,"origin":"watch"}');
INSERT INTO events VALUES(2,1795391373170,1,'started','{"asset":"wall","state":"running","attempt":1}');
INSERT INTO events VALUES(3,1795391375158,1,'succeeded','{"asset":"wall","state":"succeeded","attempt":1,"exit_code":0,"revision":"r0001"}');
INSERT INTO events VALUES(4,1795391377679,2,'submitted','{"asset":"broken","state":"queued","attempt":0,"origin":"watch"}');
INSERT INTO events VALUES(5,1795391377685,2,'started','{"asset":"broken","state":"running","attempt":1}');
INSERT INTO events VALUES(6,1795391378753,2,'failed','{"asset":"broken","state":"failed","attempt":1,"exit_code":3,"error":"corrupt_data","message":"/srv/patina/drop/broken/broken_albedo.png: this png file is truncated or damaged (Read error: hit end of file; PNG read error: IDAT: Read error: hit end of file; PNG library error); replace it by an intact copy"}');
INSERT INTO events VALUES(7,1795391391324,0,'queue_paused','{}');
INSERT INTO events VALUES(8,1795391392339,3,'submitted','{"asset":"later","state":"queued","attempt":0,"origin":"watch"}');
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
INSERT INTO assets VALUES('/srv/patina/baked','broken','/srv/patina/drop/broken','a9a1bf003232ef4824caad75662a04618d8bf46fba842ecc4c1ae0293e6287c5','/srv/patina/drop/broken.failed.json',2,1795391377679,0);
INSERT INTO assets VALUES('/srv/patina/baked','later','/srv/patina/drop/later','e4813dbbf6b64f178c29a441e6d50da0b9c782d273914b2073af73153710abe4','/srv/patina/drop/later.failed.json',3,1795391392339,0);
INSERT INTO assets VALUES('/srv/patina/baked','wall','/srv/patina/drop/wall','f3387ba8638801a3565c815d3305dbc2ad3ffd30b93a43bd680b45b2bcaa0f0a','/srv/patina/drop/wall.failed.json',1,1795391373161,0);
CREATE TABLE settings (
  name  TEXT PRIMARY KEY,
  value TEXT NOT NULL
) STRICT, WITHOUT ROWID;
INSERT INTO settings VALUES('paused','1');
DELETE FROM sqlite_sequence;
INSERT INTO sqlite_sequence VALUES('jobs',3);
INSERT INTO sqlite_sequence VALUES('events',8);
CREATE INDEX jobs_by_state ON jobs (state, id);
CREATE INDEX jobs_by_asset ON jobs (out, asset, state);
CREATE INDEX jobs_to_run ON jobs (priority DESC, id) WHERE state = 1 AND held = 0;
CREATE INDEX jobs_due ON jobs (due_ms) WHERE state = 6;
COMMIT;
PRAGMA user_version = 1;
