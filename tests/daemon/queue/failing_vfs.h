// SQLite's file calls, of which the N-th fails.
#pragma once

namespace patina::daemon::test {

// From now on databases that are opened go through it (until UseRealVfs); counting starts with
// zero. fail_at: number of the write, sync, truncation or creation that fails, -1: none. Where
// `and_all_after` is set the ones that follow fail, too, as on a full disk.
void UseFailingVfs(int fail_at, bool and_all_after);
// As UseFailingVfs(-1), and calls this at every counted call, before it is made.
void UseWatchedVfs(void (*on_call)());
// Nothing fails any more.
void MendVfs();
void UseRealVfs();
// Calls that were counted.
int VfsCalls();

}  // namespace patina::daemon::test
