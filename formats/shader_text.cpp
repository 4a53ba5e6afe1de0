#include "formats/shader_text.h"

#include <charconv>
#include <set>

#include "formats/base/check.h"
#include "formats/embedded_shaders.h"

namespace patina {
namespace {

const char* TextOf(const std::string& name) {
  for (int i = 0; i < kEmbeddedShaderCount; ++i) {
    if (name == kEmbeddedShaders[i].name) return kEmbeddedShaders[i].text;
  }
  PATINA_CHECK(false);
  return "";
}

// A role as part of an identifier: lower-case letters, digits and single underscores.
std::string Identifier(const std::string& role) {
  std::string name;
  for (const char c : role) {
    const bool legal = (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9');
    if (legal) {
      name += c;
    } else if (c >= 'A' && c <= 'Z') {
      name += static_cast<char>(c - 'A' + 'a');
    } else if (!name.empty() && name.back() != '_') {
      name += '_';  // two in a row are reserved in GLSL
    }
  }
  while (!name.empty() && name.back() == '_') name.pop_back();
  return name.empty() ? "unnamed" : name;
}

}  // namespace

std::string ShaderSource(const std::string& name) {
  constexpr const char* kInclude = "#include \"";
  std::string text = TextOf(name);
  for (size_t at = text.find(kInclude); at != std::string::npos; at = text.find(kInclude, at)) {
    const size_t begin = at + std::string(kInclude).size();
    const size_t end = text.find('"', begin);
    PATINA_CHECK(end != std::string::npos);
    const std::string included = ShaderSource(text.substr(begin, end - begin));
    text.replace(at, end + 2 - at, included);
    at += included.size();
  }
  return text;
}

std::string ShaderNumber(float value) {
  char buffer[32];
  const std::to_chars_result written = std::to_chars(buffer, buffer + sizeof buffer, value);
  std::string text(buffer, written.ptr);
  if (text.find_first_of(".e") == std::string::npos) text += ".0";
  return text;
}

std::string MapAccessors(const std::vector<ManifestChannel>& channels) {
  std::string text;
  std::set<std::string> used;
  for (size_t first = 0; first < channels.size();) {
    size_t end = first + 1;
    while (end < channels.size() && channels[end].map == channels[first].map) ++end;
    const size_t count = end - first;
    const std::string base = Identifier(channels[first].map);
    std::string name = base;
    for (int copy = 2; !used.insert(name).second; ++copy) name = base + "_" + std::to_string(copy);
    std::string values;
    for (size_t c = first; c < end; ++c)
      values += (c > first ? ", " : "") + ("m.value[" + std::to_string(c) + "]");
    const bool normal = count == 2 && channels[first].encoding == "normal_xy";
    if (normal) values += ", patina_normal_z(" + values + ")";
    if (count == 1) {
      text += "float patina_map_" + name + "(PatinaMaterial m) { return " + values + "; }\n";
    } else if (count <= 4) {
      const std::string type = "PATINA_VEC" + std::to_string(normal ? 3 : count);
      text += type + " patina_map_" + name + "(PatinaMaterial m) { return " + type + "(" + values +
              "); }\n";
    }
    first = end;
  }
  return text;
}

}  // namespace patina
