#include "tests/daemon/queue/failing_vfs.h"

#include <sqlite3.h>

#include <cstring>

namespace patina::daemon::test {
namespace {

int calls = 0;
int fail_at = -1;
bool and_all_after = false;
void (*on_call)() = nullptr;

bool Fails() {
  if (on_call != nullptr) on_call();
  const int call = calls++;
  return fail_at >= 0 && (call == fail_at || (and_all_after && call > fail_at));
}

sqlite3_vfs* Real() {
  static sqlite3_vfs* real = sqlite3_vfs_find("unix");
  return real;
}

struct File {
  sqlite3_file base;
  sqlite3_file* real;  // lies behind this
};

sqlite3_file* RealOf(sqlite3_file* file) { return reinterpret_cast<File*>(file)->real; }

int Write(sqlite3_file* file, const void* data, int size, sqlite3_int64 offset) {
  if (Fails()) {
    RealOf(file)->pMethods->xWrite(RealOf(file), data, size / 2, offset);
    return SQLITE_FULL;
  }
  return RealOf(file)->pMethods->xWrite(RealOf(file), data, size, offset);
}
int Sync(sqlite3_file*, int) {
  // No power is cut here: what is written is there.
  return Fails() ? SQLITE_IOERR_FSYNC : SQLITE_OK;
}
int Truncate(sqlite3_file* file, sqlite3_int64 size) {
  return Fails() ? SQLITE_IOERR_TRUNCATE : RealOf(file)->pMethods->xTruncate(RealOf(file), size);
}
int Close(sqlite3_file* file) { return RealOf(file)->pMethods->xClose(RealOf(file)); }
int Read(sqlite3_file* file, void* data, int size, sqlite3_int64 offset) {
  return RealOf(file)->pMethods->xRead(RealOf(file), data, size, offset);
}
int FileSize(sqlite3_file* file, sqlite3_int64* size) {
  return RealOf(file)->pMethods->xFileSize(RealOf(file), size);
}
int Lock(sqlite3_file* file, int level) {
  return RealOf(file)->pMethods->xLock(RealOf(file), level);
}
int Unlock(sqlite3_file* file, int level) {
  return RealOf(file)->pMethods->xUnlock(RealOf(file), level);
}
int CheckReserved(sqlite3_file* file, int* result) {
  return RealOf(file)->pMethods->xCheckReservedLock(RealOf(file), result);
}
int Control(sqlite3_file* file, int operation, void* argument) {
  return RealOf(file)->pMethods->xFileControl(RealOf(file), operation, argument);
}
int SectorSize(sqlite3_file* file) { return RealOf(file)->pMethods->xSectorSize(RealOf(file)); }
int Characteristics(sqlite3_file* file) {
  return RealOf(file)->pMethods->xDeviceCharacteristics(RealOf(file));
}
int ShmMap(sqlite3_file* file, int page, int size, int extend, void volatile** memory) {
  if (extend != 0 && Fails()) return SQLITE_IOERR_SHMSIZE;
  return RealOf(file)->pMethods->xShmMap(RealOf(file), page, size, extend, memory);
}
int ShmLock(sqlite3_file* file, int offset, int n, int flags) {
  return RealOf(file)->pMethods->xShmLock(RealOf(file), offset, n, flags);
}
void ShmBarrier(sqlite3_file* file) { RealOf(file)->pMethods->xShmBarrier(RealOf(file)); }
int ShmUnmap(sqlite3_file* file, int remove) {
  return RealOf(file)->pMethods->xShmUnmap(RealOf(file), remove);
}

const sqlite3_io_methods kMethods = {
    2,        Close,         Read,    Write,      Truncate,        Sync,   FileSize, Lock,
    Unlock,   CheckReserved, Control, SectorSize, Characteristics, ShmMap, ShmLock,  ShmBarrier,
    ShmUnmap, nullptr,       nullptr};

int Open(sqlite3_vfs*, const char* name, sqlite3_file* file, int flags, int* out_flags) {
  auto* wrapped = reinterpret_cast<File*>(file);
  wrapped->base.pMethods = nullptr;
  if (Fails()) return SQLITE_CANTOPEN;
  wrapped->real = reinterpret_cast<sqlite3_file*>(wrapped + 1);
  const int code = Real()->xOpen(Real(), name, wrapped->real, flags, out_flags);
  if (wrapped->real->pMethods != nullptr) wrapped->base.pMethods = &kMethods;
  return code;
}

}  // namespace

void UseFailingVfs(int at, bool all_after) {
  static sqlite3_vfs vfs = [] {
    sqlite3_vfs made = *Real();
    made.szOsFile = static_cast<int>(sizeof(File)) + Real()->szOsFile;
    made.zName = "failing";
    made.pNext = nullptr;
    made.xOpen = Open;
    return made;
  }();
  calls = 0;
  fail_at = at;
  and_all_after = all_after;
  sqlite3_vfs_register(&vfs, 1);
}

void UseWatchedVfs(void (*call)()) {
  UseFailingVfs(-1, false);
  on_call = call;
}

void MendVfs() { fail_at = -1; }

void UseRealVfs() { sqlite3_vfs_register(Real(), 1); }

int VfsCalls() { return calls; }

}  // namespace patina::daemon::test
