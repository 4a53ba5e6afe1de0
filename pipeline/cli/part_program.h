// Programs that are parts of `patina`, in ../libexec/patina: below a build, /usr and any other prefix.
#pragma once

#include <string>

namespace patina {

// Becomes that program; argv ends with nullptr. Signals, working folder and descriptors are
// inherited; the process stays the same, so who waits for it or ends it need not know. Returns only
// if that fails, with the exit code and the error printed.
int BecomePart(const std::string& name, char* const argv[]);

}  // namespace patina
