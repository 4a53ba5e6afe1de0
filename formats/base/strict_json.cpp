#include "formats/base/strict_json.h"

#include <set>
#include <utility>
#include <vector>

namespace patina {

Result<nlohmann::json> ParseStrictJson(std::string_view text, int deepest) {
  using Json = nlohmann::json;
  std::vector<std::set<std::string>> keys;
  std::string twice;
  bool too_deep = false;
  const auto watch = [&](int depth, Json::parse_event_t event, Json& parsed) {
    too_deep = too_deep || depth > deepest;
    if (too_deep) return false;
    if (event == Json::parse_event_t::object_start) {
      keys.emplace_back();
    } else if (event == Json::parse_event_t::object_end) {
      keys.pop_back();
    } else if (event == Json::parse_event_t::key) {
      std::string key = parsed.get<std::string>();
      if (!keys.back().insert(key).second && twice.empty()) twice = std::move(key);
    }
    return true;
  };
  Json json;
  try {
    json = Json::parse(text.begin(), text.end(), watch);
  } catch (const Json::exception& error) {
    return Fail(ErrorCode::kInvalidArgument, std::string("not JSON: ") + error.what());
  }
  if (too_deep) {
    return Fail(ErrorCode::kInvalidArgument,
                "nested deeper than " + std::to_string(deepest) + " levels");
  }
  if (!twice.empty()) {
    return Fail(ErrorCode::kInvalidArgument,
                "the key \"" + twice + "\" stands twice in one object; keep one");
  }
  return json;
}

std::string EscapePointer(std::string_view key) {
  std::string out;
  for (const char c : key) {
    if (c == '~') {
      out += "~0";
    } else if (c == '/') {
      out += "~1";
    } else {
      out += c;
    }
  }
  return out;
}

}  // namespace patina
