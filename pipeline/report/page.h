// A page of HTML in one file: nothing of it lies elsewhere, and no script runs in it.
#pragma once

#include <string>

#include "pipeline/report/html.h"

namespace patina {

// The page from its head to an open <main>; what follows goes there.
Html BeginPage(const std::string& title);

// The text of the file.
std::string FinishPage(Html html);

// A part with a heading, closed by Close(). id: of ours, to jump to.
void OpenSection(const char* id, const std::string& heading, Html* html);

}  // namespace patina
