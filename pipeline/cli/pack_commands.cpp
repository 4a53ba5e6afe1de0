#include <unistd.h>

#include <cerrno>
#include <cstdio>

#include "formats/base/file_io.h"
#include "formats/container_archive.h"
#include "pipeline/cli/commands.h"
#include "pipeline/jobs/job_result.h"

namespace patina {
namespace {

Status WriteAll(int fd, std::span<const uint8_t> bytes, const std::string& path) {
  while (!bytes.empty()) {
    const ssize_t written = ::write(fd, bytes.data(), bytes.size());
    if (written >= 0) {
      bytes = bytes.subspan(static_cast<size_t>(written));
    } else if (errno != EINTR) {
      return FailErrno(errno, "cannot write", path);
    }
  }
  return {};
}

Result<size_t> ReadSome(int fd, std::span<uint8_t> out) {
  for (;;) {
    const ssize_t got = ::read(fd, out.data(), out.size());
    if (got >= 0) return static_cast<size_t>(got);
    if (errno != EINTR) return FailErrno(errno, "cannot read", "standard input");
  }
}

// One line for a member: its size, what it takes in the archive, and what zstd saved.
std::string SavedLine(const std::string& name, uint64_t content, uint64_t frame) {
  const double saved =
      content == 0 ? 0 : 100 * (1 - static_cast<double>(frame) / static_cast<double>(content));
  char text[192];
  std::snprintf(text, sizeof text, "%-24s %12s %12s   %5.1f %%\n", name.c_str(),
                BytesText(static_cast<double>(content)).c_str(),
                BytesText(static_cast<double>(frame)).c_str(), saved);
  return text;
}

void PrintSaved(const std::vector<ArchiveMember>& members, std::FILE* out) {
  uint64_t content = 0, frames = 0;
  std::fprintf(out, "%-24s %12s %12s   %7s\n", "file", "bytes", "packed", "saved");
  for (const ArchiveMember& member : members) {
    std::fputs(SavedLine(member.name, member.content_bytes, member.frame_bytes).c_str(), out);
    content += member.content_bytes;
    frames += member.frame_bytes;
  }
  std::fputs(SavedLine("all", content, frames).c_str(), out);
}

// Tells of members as they are done, where that takes long.
class MemberProgress {
 public:
  MemberProgress(const CommandLine& line, const CancelToken& cancel)
      : cancel_(cancel), progress_(stderr, line.verbosity, "patina") {}
  void operator()(const ArchiveMember& member) {
    if (member.content_bytes < kSmallBytes) return;
    ProgressEvent event;
    event.stage = member.name;
    progress_.OnProgress(event);
  }
  bool cancelled() const { return cancel_.cancelled(); }
  void Done() { progress_.OnResult({}); }

 private:
  static constexpr uint64_t kSmallBytes = uint64_t{8} << 20;
  const CancelToken& cancel_;
  TerminalProgress progress_;
};

tl::unexpected<Error> Interrupted() {
  return Fail(ErrorCode::kCancelled, "interrupted; nothing was written");
}

}  // namespace

int PackCommand(const CommandLine& line, const CancelToken& cancel) {
  const PackArguments& given = line.pack;
  const auto container = OpenContainer(given.container);
  if (!container) return FailCommand(container.error());
  const bool to_stdout = given.out == "-";
  const std::string temporary = given.out + ".tmp-" + std::to_string(::getpid());
  std::FILE* file = to_stdout ? stdout : std::fopen(temporary.c_str(), "wb");
  if (file == nullptr) return FailCommand(FailErrno(errno, "cannot write", given.out).value());
  MemberProgress progress(line, cancel);
  auto packed = PackContainer(
      *container, given.level,
      [&](std::span<const uint8_t> bytes) -> Status {
        if (progress.cancelled()) return Interrupted();
        return WriteAll(::fileno(file), bytes, to_stdout ? "standard output" : given.out);
      },
      [&](const ArchiveMember& member) { progress(member); });
  progress.Done();
  Status done = packed ? Status() : Status(Fail(packed.error()));
  if (!to_stdout) {
    FileSystem& files = RealFileSystem();
    std::fclose(file);
    int failed = done ? files.Sync(temporary) : 0;
    if (done && failed == 0) failed = files.Rename(temporary, given.out);
    if (failed != 0) done = FailErrno(failed, "cannot write", given.out);
    if (!done) files.RemoveFile(temporary);
  }
  if (!done) return FailCommand(done.error());
  for (const std::string& name : packed->left_out) {
    std::fprintf(stderr, "patina: warning: %s is not in the manifest and was not packed\n",
                 name.c_str());
  }
  // The table is for a person; the archive may be on standard output.
  if (line.verbosity != Verbosity::kQuiet) PrintSaved(packed->members, to_stdout ? stderr : stdout);
  return kExitDone;
}

int UnpackArchiveCommand(const CommandLine& line, const CancelToken& cancel) {
  const PackArguments& given = line.pack;
  ReadBytes read = [](std::span<uint8_t> out) { return ReadSome(STDIN_FILENO, out); };
  if (given.archive != "-") {
    auto pieces = ReadPieces(given.archive);
    if (!pieces) return FailCommand(pieces.error());
    read = std::move(*pieces);
  }
  MemberProgress progress(line, cancel);
  const auto members = UnpackArchive(
      [&](std::span<uint8_t> out) -> Result<size_t> {
        if (progress.cancelled()) return Interrupted();
        return read(out);
      },
      given.out, given.max_bytes, [&](const ArchiveMember& member) { progress(member); });
  progress.Done();
  if (!members) {
    const std::string name = given.archive == "-" ? "standard input" : given.archive;
    return FailCommand(Fail(members.error(), name).value());
  }
  if (line.verbosity != Verbosity::kQuiet) std::printf("%s\n", given.out.c_str());
  return kExitDone;
}

}  // namespace patina
