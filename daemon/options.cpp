#include "daemon/options.h"

#include <getopt.h>

#include "formats/base/names.h"
#include "pipeline/jobs/job_result.h"

namespace patina::daemon {
namespace {

constexpr const char* kHelp =
    R"(patinad bakes what is put into a folder, and what is submitted to it.

usage: patinad --watch DIR --out DIR [OPTION...]
       patinad --config FILE [OPTION...]
       patinad --check-config [--config FILE] [OPTION...]

  -w, --watch DIR        Drop folder; may be given several times. Each folder of maps and each
                         measured BRDF in it is baked once it is complete, and again when it
                         changes. What fails leaves ASSET.failed.json beside it.
  -o, --out DIR          Folder for the containers
  -c, --config FILE      Configuration (schemas/config.schema.json); $PATINA_CONFIG
  -s, --state DIR        Queue, logs, socket and lock (default: ~/.local/state/patina)
      --failed DIR       Folder for ASSET.failed.json (default: beside the asset)
      --socket PATH      Unix socket of the API (default: patinad.sock in the state folder)
      --listen ADDR:PORT
                          Also serve the API, and a dashboard for browsers, on a loopback address
      --token-file FILE  The bearer token of TCP clients, in a file of mode 0600
                          (default: token in the state folder, made at the first start)
      --worker FILE      The patina program (default: the one beside patinad)
      --cores N          Cores that all jobs together may use (default: all)
      --log-level LEVEL  debug, info (default), warning, error
      --log-format F     json (default), text
      --check-config     Say all that is wrong with the configuration, and exit; also asks Slurm, if
                         that is the executor, whether it would take a job
      --print-config     Print the configuration in effect, and exit
  -h, --help
  -V, --version

Jobs run on this machine, or on a farm: "executor" in the configuration, of the kind "slurm", or
"command" for any that has programs to submit, list and cancel jobs.

Flags come over environment (PATINA_WATCH=DIR:DIR, PATINA_OUT, PATINA_STATE_DIR, ...), and that
over the file. $OCIO names the OpenColorIO configuration of jobs that name none. Signals: HUP reads
the configuration again; TERM and INT stop, after the running jobs have ended or been put back into
the queue; a second one does not wait for them.

Exit codes: 0 stopped or all is well, 1 failed, 2 wrong usage, 3 wrong configuration.

  patinad --watch ~/drop --out ~/baked
  patina status; patina jobs; patina watch
  patinad --watch ~/drop --out ~/baked --listen 127.0.0.1:7420
)";

}  // namespace

ParsedOptions ParseOptions(int argc, char** argv) {
  enum : int {
    kFailed = 256,
    kSocket,
    kListen,
    kToken,
    kWorker,
    kCores,
    kLevel,
    kFormat,
    kCheck,
    kPrint
  };
  static const option kLong[] = {{"watch", required_argument, nullptr, 'w'},
                                 {"out", required_argument, nullptr, 'o'},
                                 {"config", required_argument, nullptr, 'c'},
                                 {"state", required_argument, nullptr, 's'},
                                 {"failed", required_argument, nullptr, kFailed},
                                 {"socket", required_argument, nullptr, kSocket},
                                 {"listen", required_argument, nullptr, kListen},
                                 {"token-file", required_argument, nullptr, kToken},
                                 {"worker", required_argument, nullptr, kWorker},
                                 {"cores", required_argument, nullptr, kCores},
                                 {"log-level", required_argument, nullptr, kLevel},
                                 {"log-format", required_argument, nullptr, kFormat},
                                 {"check-config", no_argument, nullptr, kCheck},
                                 {"print-config", no_argument, nullptr, kPrint},
                                 {"help", no_argument, nullptr, 'h'},
                                 {"version", no_argument, nullptr, 'V'},
                                 {nullptr, 0, nullptr, 0}};
  ParsedOptions parsed;
  const auto usage = [&parsed](const std::string& what) {
    parsed.exit_code = kExitUsage;
    parsed.text = what + "; see `patinad --help`";
    return parsed;
  };
  Options& o = parsed.options;
  ConfigOverrides& c = o.overrides;
  opterr = 0;
  optind = 1;
  for (;;) {
    const int at = optind;
    const int found = ::getopt_long(argc, argv, ":w:o:c:s:hV", kLong, nullptr);
    if (found == -1) break;
    switch (found) {
      case 'w':
        c.watch.emplace_back(optarg);
        break;
      case 'o':
        c.out = optarg;
        break;
      case 'c':
        o.config_file = optarg;
        break;
      case 's':
        c.state_dir = optarg;
        break;
      case kFailed:
        c.failed_dir = optarg;
        break;
      case kSocket:
        c.socket = optarg;
        break;
      case kListen:
        c.listen = optarg;
        break;
      case kToken:
        c.token_file = optarg;
        break;
      case kWorker:
        c.worker = optarg;
        break;
      case kCores:
        c.cores = optarg;
        break;
      case kLevel:
        c.log_level = optarg;
        break;
      case kFormat:
        c.log_format = optarg;
        break;
      case kCheck:
        o.check_config = true;
        break;
      case kPrint:
        o.print_config = true;
        break;
      case 'h':
        parsed.text = kHelp;
        return parsed;
      case 'V':
        parsed.text = std::string("patinad ") + PATINA_VERSION + "\n";
        return parsed;
      case ':':
        return usage(QuoteForMessage(argv[at]) + " needs a value");
      default:
        return usage("there is no option " + QuoteForMessage(argv[at]));
    }
  }
  if (optind < argc) return usage(QuoteForMessage(argv[optind]) + " is not expected here");
  parsed.run = true;
  return parsed;
}

}  // namespace patina::daemon
