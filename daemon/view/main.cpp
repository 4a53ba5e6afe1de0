// The server of `patina view`, which starts it: patina-view PORT BROWSER SOURCE CONTAINER, with
// BROWSER 0 or 1 and SOURCE empty or a folder of maps.
#include <charconv>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <exception>

#include "daemon/api/http_server.h"
#include "daemon/api/listeners.h"
#include "daemon/api/tickets.h"
#include "daemon/view/browser.h"
#include "daemon/view/view_handler.h"
#include "pipeline/cli/terminal_progress.h"
#include "pipeline/jobs/job_result.h"

namespace patina::daemon {
namespace {

constexpr size_t kTokenBytes = 24;

int FailWith(const Error& error) {
  std::fprintf(stderr, "patina: error: %s\n", error.message.c_str());
  return ExitCodeFor(error, true);
}

sigset_t EndingSignals() {
  sigset_t set;
  sigemptyset(&set);
  for (const int number : {SIGINT, SIGTERM, SIGHUP}) sigaddset(&set, number);
  return set;
}

int Main(int port, bool with_browser, const std::string& source, const std::string& path) {
  auto container = OpenContainer(path);
  if (!container) return FailWith(container.error());
  const std::string& kind = container->manifest.kind;
  if (kind != "material" && kind != "brdf" && kind != "svbrdf") {
    return FailWith({ErrorCode::kUnsupported, container->directory +
                                                  ": the viewer does not show kind " + kind +
                                                  "; its report.html has pictures of it"});
  }
  // What is damaged is said here, where whoever asked reads it, not only on the page.
  const Status whole = VerifyPayloads(*container);
  if (!whole) return FailWith(whole.error());
  std::unique_ptr<const SourceTextures> textures;
  if (!source.empty()) {
    ThreadPool pool(0);
    TerminalProgress progress(stderr, Verbosity::kNormal, container->manifest.asset);
    auto loaded = SourceTextures::Load(*container, source, pool, CancelToken(), progress);
    progress.OnResult({});
    if (!loaded) return FailWith(loaded.error());
    textures = std::move(*loaded);
  }
  // Threads inherit what is held back; this one waits for it.
  const sigset_t ending = EndingSignals();
  pthread_sigmask(SIG_BLOCK, &ending, nullptr);
  auto token = RandomName(kTokenBytes);
  if (!token) return FailWith(token.error());
  auto listener = OpenTcpListener("127.0.0.1", port);
  if (!listener) return FailWith(listener.error());
  const std::string shown = container->manifest.asset;
  const std::string directory = container->directory;
  ViewHandler handler(std::move(*container), *token, textures.get());
  HttpLimits limits;
  limits.max_connections = 32;
  limits.max_body_bytes = 1024;  // nothing here takes one
  auto server = HttpServer::Start(limits, {{listener->fd.get(), true}}, &handler);
  if (!server) return FailWith(server.error());
  // Behind the #, which browsers keep to themselves.
  const std::string url =
      "http://127.0.0.1:" + std::to_string(listener->port) + "/#token=" + *token;
  std::printf("%s\n", url.c_str());
  std::fflush(stdout);
  const bool opened = with_browser && OpenBrowser(url);
  std::fprintf(stderr, "%s is shown %s; Ctrl-C ends it. (%s)\n", shown.c_str(),
               opened ? "in your browser" : "at the address above, on this machine",
               directory.c_str());
  int number = 0;
  sigwait(&ending, &number);
  return kExitDone;
}

int Run(int argc, char** argv) {
  int port = 0;
  const bool legal =
      argc == 5 && (std::strcmp(argv[2], "0") == 0 || std::strcmp(argv[2], "1") == 0);
  const char* const end = legal ? argv[1] + std::strlen(argv[1]) : nullptr;
  if (!legal || std::from_chars(argv[1], end, port).ptr != end || port < 0 || port > 65535) {
    std::fprintf(stderr, "patina-view: this is a part of `patina`; use `patina view --help`\n");
    return kExitUsage;
  }
  return Main(port, argv[2][0] == '1', argv[3], argv[4]);
}

}  // namespace
}  // namespace patina::daemon

int main(int argc, char** argv) {
  try {
    return patina::daemon::Run(argc, argv);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "patina: error: unexpected failure: %s\n", error.what());
  }
  return patina::kExitFailed;
}
