// The command line of patinad.
#pragma once

#include <string>
#include <vector>

#include "daemon/config/config.h"

namespace patina::daemon {

struct Options {
  std::string config_file;  // empty: none
  ConfigOverrides overrides;
  bool check_config = false;
  bool print_config = false;
};

// What came of parsing: options, or text to print and a code to exit with.
struct ParsedOptions {
  bool run = false;
  Options options;
  int exit_code = 0;
  std::string text;  // help or version if exit_code is 0, else the error
};

ParsedOptions ParseOptions(int argc, char** argv);

}  // namespace patina::daemon
