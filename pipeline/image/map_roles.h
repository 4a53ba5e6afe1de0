// What the maps of a material are called: the closed set of roles, and the words in file names that
// mean them.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace patina {

enum class MapKind {
  kColor,   // components r, g, b
  kNormal,  // components x, y of a unit tangent-space vector
  kScalar,  // one component
  kVector2  // components x, y, as the file has them
};

// Which way the Y axis of a normal map points: up (OpenGL) or down (DirectX).
enum class NormalConvention { kAuto, kOpenGl, kDirectX };
const char* NormalConventionName(NormalConvention convention);  // "auto", "opengl", "directx"
std::optional<NormalConvention> ParseNormalConvention(std::string_view name);

struct MapRole {
  const char* name;  // reaches manifests: never renamed
  MapKind kind;
  // Of a scalar in a file of several channels, by the conventions of glTF 2.0 and its KHR
  // extensions.
  char usual_channel;
};

// All roles, in the order of a manifest.
const std::vector<MapRole>& MapRoles();
// The role of that name, or nullptr.
const MapRole* FindMapRole(std::string_view name);
// Position in MapRoles(); the name must be one of them.
int MapRoleIndex(std::string_view name);

// One map inside a file.
struct TokenPart {
  const char* role;
  const char* channels;   // "rgb", "r", "a", ...; "" lets the content decide
  bool invert = false;    // the file holds 1 - value
  bool optional = false;  // no map if the channel is 1 everywhere
};

// Preference among files that claim one role: the smaller rank wins; equal ranks with different
// words are a conflict.
inline constexpr int kOwnFileRank = 0;
inline constexpr int kStandInRank = 1;  // what may stand in: gloss, bump, mask, a single letter
inline constexpr int kPackedRank = 2;   // a channel of a packed file
inline constexpr int kAlphaRank = 3;    // the alpha channel of a colour map

// A word of a file name and what it says about the file.
struct MapToken {
  std::string name;  // lower case, without separators: "occlusionroughnessmetallic"
  std::vector<TokenPart> parts;
  // Instead of `parts` for a file of three or more channels, if not empty.
  std::vector<TokenPart> wide_parts;
  int rank = kOwnFileRank;
  // Also a common word for materials ("rusty_metal") or a single letter: not believed without other
  // maps beside it.
  bool weak = false;
  NormalConvention convention = NormalConvention::kAuto;
};

// The token of that squashed lower-case name, or nullptr.
const MapToken* FindMapToken(std::string_view name);
// Names of the common tokens, for messages: "albedo, basecolor, ...".
std::string KnownTokensText();

}  // namespace patina
