// Who may use the API over TCP. (On the Unix socket the file's mode decides.)
#pragma once

#include <string>
#include <string_view>

#include "daemon/api/http_types.h"
#include "formats/base/result.h"

namespace patina::daemon {

// The token in a file: its content without white space at the end. Errors: those of ReadTextFile;
// kInvalidArgument: others than the owner may read or write the file, or what is in it is shorter
// than 16 characters or not made of those that a header can carry.
Result<std::string> ReadTokenFile(const std::string& path);

// The same, of a file that is made with a random token, for its owner alone, if it is not there.
// Errors: also kIo (it cannot be made).
Result<std::string> ReadOrMakeTokenFile(const std::string& path);

// Whether an Authorization header carries the token; takes the same time for every wrong one.
bool CarriesToken(std::string_view authorization, std::string_view token);

// Whether a Host header means this machine: 127.x.y.z, [::1] or localhost, with any port. A page of
// another site whose name was made to point here carries that site's name.
bool IsLocalHost(std::string_view host);

// Whether a browser sends a request for a page of another site: its Origin is not the Host that is
// asked, or, of what changes something, Sec-Fetch-Site says so, or the body is of a type that a
// form can send anywhere unasked. What is no browser sends none of these.
bool IsCrossSite(const HttpRequest& request);

}  // namespace patina::daemon
