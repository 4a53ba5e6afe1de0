#include "pipeline/base/progress.h"

namespace patina {
namespace {

class SilentSink : public ProgressSink {
 public:
  void OnProgress(const ProgressEvent&) override {}
  void OnWarning(const std::string&) override {}
};

}  // namespace

ProgressSink& NoProgress() {
  static SilentSink sink;
  return sink;
}

}  // namespace patina
