// An OpenColorIO configuration: names of colour spaces, file rules, and conversions to and from the
// working space. The only file behind this header knows OpenColorIO, and its exceptions stop there.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "formats/base/result.h"
#include "pipeline/color/color_transform.h"
#include "pipeline/color/primaries.h"

namespace patina {

inline constexpr size_t kMaxColorConfigBytes = size_t{16} << 20;
inline constexpr uint64_t kMaxColorLutBytes = uint64_t{1} << 30;

// Where a configuration comes from. Names reach the manifest.
enum class ConfigSource { kBuiltin, kEnvironment, kFile };
const char* ConfigSourceName(ConfigSource source);  // "builtin", "environment", "file"

// One colour space of a configuration.
struct ConfigSpace {
  std::string name;      // as the configuration spells it, whatever alias or role found it
  bool is_data = false;  // never converted: values are taken as they are
};

// Immutable and cheap to copy; safe from any thread.
class ColorConfig {
 public:
  // The built-in one. Spaces: ACES2065-1, ACEScg, lin_rec709, sRGB (IEC 61966-2-1), Rec.709 (the
  // camera's curve of BT.709), raw (data). No file rules.
  static ColorConfig Builtin();

  // The configuration in `file`; if that is empty the one that $OCIO names; if that is empty or not
  // set, the built-in one. Errors, with path and remedy: kNotFound, kIo, kOutOfRange (larger than
  // kMaxColorConfigBytes, or a table larger than kMaxColorLutBytes), kCorruptData (not a
  // configuration), kUnsupported (of a later OpenColorIO).
  static Result<ColorConfig> Load(const std::string& file);

  ConfigSource source() const;
  const std::string& file() const;  // empty if built in

  // SHA-256, 64 hex digits, of the configuration's text and of every table that its spaces, looks
  // and view transforms refer to (by the name it has there, and its content). OpenColorIO's own
  // cacheID does not serve: it stands for tables by inode and time, and differs between machines.
  const std::string& sha256() const;

  // The space of that name, alias or role; case does not matter.
  // Errors: kInvalidArgument with the nearest names.
  Result<ConfigSpace> Find(const std::string& name) const;
  std::vector<ConfigSpace> Spaces() const;

  // The space that the file rules give a path; none where only the default rule, which says nothing
  // about the file, applies.
  std::optional<ConfigSpace> FileRule(const std::string& path) const;

  // Between a space that is not data and linear RGB of the working space. The working space of a
  // file is found in it as the space that does what the primaries say (roles scene_linear and
  // rendering and customary names are tried), else by its role aces_interchange and a matrix.
  // Errors: kInvalidArgument (neither is there), kCorruptData (a table is missing or damaged).
  Result<ColorTransformPtr> ToWorking(const ConfigSpace& space, WorkingSpace working) const;
  Result<ColorTransformPtr> FromWorking(const ConfigSpace& space, WorkingSpace working) const;

 private:
  struct Data;
  explicit ColorConfig(std::shared_ptr<const Data> data) : data_(std::move(data)) {}
  Result<ColorTransformPtr> Convert(const ConfigSpace& space, WorkingSpace working,
                                    bool to_working) const;
  std::shared_ptr<const Data> data_;
};

}  // namespace patina
