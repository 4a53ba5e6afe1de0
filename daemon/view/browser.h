// The browser of whoever sits before this machine.
#pragma once

#include <string>

namespace patina::daemon {

// Hands a URL to xdg-open, without a shell and without waiting for it. False where there is no
// desktop to open it on, or no xdg-open.
bool OpenBrowser(const std::string& url);

}  // namespace patina::daemon
