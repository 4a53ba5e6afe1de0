// Paths and addresses as a configuration names them.
#pragma once

#include <string>

namespace patina::daemon {

// Without "." and "..", without a slash at its end; relative to `base`, or to the working directory
// if that is empty.
std::string AbsolutePath(const std::string& path, const std::string& base);

// The folder of a file.
std::string FolderOf(const std::string& file);

// Whether a path is a folder, or lies in it; links are resolved as far as they exist.
bool IsWithin(const std::string& path, const std::string& folder);

// "localhost", an address of 127.0.0.0/8, or "::1".
bool IsLoopback(const std::string& host);

// `patina` beside the running program, else in a folder of `path` (of $PATH; may be null); empty if
// there is none.
std::string FindWorker(const std::string* path);

}  // namespace patina::daemon
