#include "daemon/execute/sandbox.h"

#include <fcntl.h>
#include <linux/audit.h>
#include <linux/filter.h>
#include <linux/seccomp.h>
#include <sys/prctl.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <cerrno>
#include <cstddef>
#include <cstdint>

#include "formats/base/file_io.h"

namespace patina::daemon {
namespace {

// From linux/landlock.h, which in Debian 12 knows the first two versions only.
struct RulesetAttributes {
  uint64_t handled_access_fs;
  uint64_t handled_access_net;  // version 4
};
struct __attribute__((packed)) PathBeneath {
  uint64_t allowed_access;
  int32_t parent_fd;
};
constexpr unsigned kAskVersion = 1;  // LANDLOCK_CREATE_RULESET_VERSION
constexpr int kRulePathBeneath = 1;

constexpr uint64_t kExecute = 1u << 0;
constexpr uint64_t kWriteFile = 1u << 1;
constexpr uint64_t kReadFile = 1u << 2;
constexpr uint64_t kReadDirectory = 1u << 3;
constexpr uint64_t kFirstVersion = (1u << 13) - 1;  // up to MAKE_SYM
constexpr uint64_t kRefer = 1u << 13;               // version 2
constexpr uint64_t kTruncate = 1u << 14;            // version 3
constexpr uint64_t kOfFiles = kExecute | kWriteFile | kReadFile | kTruncate;
constexpr uint64_t kNetwork = 3;  // TCP: bind, connect

int CreateRuleset(const RulesetAttributes* attributes, size_t size, unsigned flags) {
  return static_cast<int>(::syscall(SYS_landlock_create_ruleset, attributes, size, flags));
}

Status AddRule(int ruleset, const std::string& path, uint64_t access) {
  const UniqueFd fd(::open(path.c_str(), O_PATH | O_CLOEXEC));
  struct stat info;
  if (!fd || ::fstat(fd.get(), &info) != 0) {
    if (errno == ENOENT || errno == ENOTDIR) return {};
    return FailErrno(errno, "cannot open", path);
  }
  if (!S_ISDIR(info.st_mode)) access &= kOfFiles;
  const PathBeneath rule{access, fd.get()};
  if (::syscall(SYS_landlock_add_rule, ruleset, kRulePathBeneath, &rule, 0) != 0)
    return FailErrno(errno, "cannot make a Landlock rule for", path);
  return {};
}

#ifdef __x86_64__
constexpr uint32_t kRefused[] = {
    SYS_socket,
    SYS_socketpair,
    SYS_ptrace,
    SYS_process_vm_readv,
    SYS_mount,
    SYS_process_vm_writev,
    SYS_umount2,
    SYS_pivot_root,
    SYS_chroot,
    SYS_unshare,
    SYS_setns,
    SYS_bpf,
    SYS_kexec_load,
    SYS_init_module,
    SYS_finit_module,
    SYS_delete_module,
    SYS_keyctl,
    SYS_add_key,
    SYS_request_key,
    SYS_perf_event_open,
    SYS_userfaultfd,
    SYS_io_uring_setup,
    SYS_open_by_handle_at,
    SYS_reboot,
    SYS_swapon,
    SYS_swapoff,
    SYS_settimeofday,
    SYS_clock_settime,
};
constexpr size_t kRefusedCount = sizeof kRefused / sizeof *kRefused;
constexpr uint32_t kX32 = 0x40000000;  // the same calls by other numbers, where the kernel has them

int Filter() {
  // Load the architecture, load the number, compare with each; no allocation, as this runs after
  // the fork.
  sock_filter program[7 + kRefusedCount];
  size_t n = 0;
  program[n++] = BPF_STMT(BPF_LD | BPF_W | BPF_ABS, offsetof(seccomp_data, arch));
  program[n++] = BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, AUDIT_ARCH_X86_64, 1, 0);
  program[n++] = BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_KILL_PROCESS);
  program[n++] = BPF_STMT(BPF_LD | BPF_W | BPF_ABS, offsetof(seccomp_data, nr));
  program[n++] = BPF_JUMP(BPF_JMP | BPF_JGE | BPF_K, kX32, kRefusedCount + 1, 0);
  for (size_t i = 0; i < kRefusedCount; ++i) {
    const auto to_refusal = static_cast<uint8_t>(kRefusedCount - i);
    program[n++] = BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, kRefused[i], to_refusal, 0);
  }
  program[n++] = BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_ALLOW);
  program[n++] = BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_ERRNO | EPERM);
  const sock_fprog filter{static_cast<unsigned short>(n), program};
  // A kernel without filters says EINVAL; the rest of the sandbox holds all the same.
  return ::prctl(PR_SET_SECCOMP, SECCOMP_MODE_FILTER, &filter) == 0 || errno == EINVAL ? 0 : errno;
}
#else
int Filter() { return 0; }
#endif

}  // namespace

int Sandbox::LandlockVersion() {
  const int version = CreateRuleset(nullptr, 0, kAskVersion);
  return version > 0 ? version : 0;
}

Result<Sandbox> Sandbox::Create(const SandboxPaths& paths) {
  const int version = LandlockVersion();
  if (version == 0) return Sandbox(UniqueFd());
  uint64_t everything = kFirstVersion;
  if (version >= 2) everything |= kRefer;
  if (version >= 3) everything |= kTruncate;
  const RulesetAttributes attributes{everything, version >= 4 ? kNetwork : 0};
  UniqueFd ruleset(CreateRuleset(
      &attributes, version >= 4 ? sizeof attributes : sizeof attributes.handled_access_fs, 0));
  if (!ruleset) return FailErrno(errno, "cannot make", "a Landlock ruleset");
  for (const std::string& path : paths.read)
    PATINA_TRY(AddRule(ruleset.get(), path, kReadFile | kReadDirectory));
  for (const std::string& path : paths.execute)
    PATINA_TRY(AddRule(ruleset.get(), path, kReadFile | kReadDirectory | kExecute));
  for (const std::string& path : paths.list)
    PATINA_TRY(AddRule(ruleset.get(), path, kReadDirectory));
  for (const std::string& path : paths.write)
    PATINA_TRY(AddRule(ruleset.get(), path, everything & ~kExecute));
  return Sandbox(std::move(ruleset));
}

int Sandbox::Apply() const {
  if (ruleset_ && ::syscall(SYS_landlock_restrict_self, ruleset_.get(), 0) != 0) return errno;
  return Filter();
}

}  // namespace patina::daemon
