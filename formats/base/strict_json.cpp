#include "formats/base/strict_json.h"

#include <algorithm>
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

std::string UnknownMember(const nlohmann::json& object, const std::string& pointer,
                          std::initializer_list<std::string_view> keys) {
  if (!object.is_object()) return "";
  for (const auto& [key, value] : object.items()) {
    if (std::find(keys.begin(), keys.end(), key) != keys.end()) continue;
    std::string known;
    for (const std::string_view k : keys) known += (known.empty() ? "" : ", ") + std::string(k);
    return pointer + "/" + EscapePointer(key) + ": is not a field here; fields: " + known;
  }
  return "";
}

}  // namespace patina
