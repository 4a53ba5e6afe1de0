// The pages of the dashboard: the files of daemon/web, which are part of this program.
#pragma once

#include <string_view>

#include "daemon/api/http_types.h"

namespace patina::daemon {

// Generated from daemon/web.
struct DashboardFile {
  const char* name;  // "app.js"
  const char* text;
};
extern const DashboardFile kDashboardFiles[];
extern const int kDashboardFileCount;

// Whether a path is that of a page: "/" or below "/web/". They hold nothing that needs a token.
bool IsDashboardPath(std::string_view path);

// A file by its name; 404 if there is none. With the policy under which a browser runs it: nothing
// but what this server sends, and in no frame.
HttpResponse DashboardResponse(std::string_view name);

}  // namespace patina::daemon
