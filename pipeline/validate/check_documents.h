// Job files, configurations, scenes and what describes baked ones.
#pragma once

#include <string>

#include "pipeline/validate/findings.h"

namespace patina::validate {

enum class DocumentKind { kNone, kJob, kConfig, kScene, kSceneManifest, kBindings };

// What a file is, by its name, and where that does not tell by its content; kNone for what is none
// of these or cannot be read.
DocumentKind KindOfDocument(const std::string& path);

// `path`: the file; `label`: how findings name it.
void CheckDocument(DocumentKind kind, const std::string& path, const std::string& label,
                   FindingList* findings);

}  // namespace patina::validate
