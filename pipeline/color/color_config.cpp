#include "pipeline/color/color_config.h"

#include <OpenColorIO/OpenColorIO.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <map>
#include <new>
#include <set>
#include <sstream>

#include "formats/base/file_io.h"
#include "formats/base/names.h"
#include "formats/base/sha256.h"
#include "formats/half.h"
#include "pipeline/color/color.h"

namespace patina {
namespace {

namespace ocio = OCIO_NAMESPACE;

// What the built-in configuration is, for its hash. Change it with what Builtin() makes.
constexpr const char* kBuiltinText =
    "patina built-in colour configuration 1\n"
    "ACES2065-1: AP0\nACEScg: AP1\nlin_rec709: BT.709 primaries, D65, Bradford\n"
    "sRGB: IEC 61966-2-1 12.92 0.04045 1.055 2.4\n"
    "Rec.709: BT.709 4.5 1.09929682680944 0.018053968510807 0.45\n"
    "raw: data\n";

// A space of a file counts as the working space when white and primaries, in ACES2065-1, are this
// near. Published matrices differ by up to 3e-4.
constexpr double kSameSpace = 1e-3;

constexpr size_t kShownNames = 3;

// Library messages may hold several lines and bytes of the file.
std::string OneLine(const std::string& text) {
  std::string line;
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    line += c == '\n' ? ' ' : byte < 0x20 || byte == 0x7F ? '?' : c;
    if (line.size() >= 400) return line + "...";
  }
  return line;
}

// Runs body and turns what the library throws into errors.
template <class Body>
auto Guarded(const std::string& context, ErrorCode code, const std::string& remedy, Body&& body)
    -> decltype(body()) {
  try {
    return body();
  } catch (const std::bad_alloc&) {
    return Fail(ErrorCode::kResourceExhausted, context + ": not enough memory");
  } catch (const std::exception& e) {
    return Fail(code, context + ": " + OneLine(e.what()) + "; " + remedy);
  } catch (...) {
    return Fail(code, context + ": OpenColorIO gave up; " + remedy);
  }
}

std::string Lower(std::string text) {
  for (char& c : text) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return text;
}

// Levenshtein distance.
size_t EditDistance(const std::string& a, const std::string& b) {
  std::vector<size_t> row(b.size() + 1);
  for (size_t j = 0; j <= b.size(); ++j) row[j] = j;
  for (size_t i = 1; i <= a.size(); ++i) {
    size_t diagonal = row[0];
    row[0] = i;
    for (size_t j = 1; j <= b.size(); ++j) {
      const size_t change = diagonal + (a[i - 1] == b[j - 1] ? 0 : 1);
      diagonal = row[j];
      row[j] = std::min({row[j] + 1, row[j - 1] + 1, change});
    }
  }
  return row[b.size()];
}

class OcioTransform : public ColorTransform {
 public:
  explicit OcioTransform(ocio::ConstCPUProcessorRcPtr processor)
      : processor_(std::move(processor)) {}

 private:
  void Convert(float* r, float* g, float* b, size_t count) const noexcept override {
    ocio::PlanarImageDesc image(r, g, b, nullptr, static_cast<long>(count), 1);
    processor_->apply(image);
  }
  ocio::ConstCPUProcessorRcPtr processor_;
};

ColorTransformPtr MakeTransform(const ocio::ConstConfigRcPtr& config,
                                const ocio::ConstTransformRcPtr& transform) {
  const auto processor = config->getProcessor(transform);
  return std::make_shared<OcioTransform>(
      processor->getOptimizedCPUProcessor(ocio::OPTIMIZATION_LOSSLESS));
}

ocio::MatrixTransformRcPtr MakeMatrix(const Matrix3& m) {
  const double m44[16] = {m[0], m[1], m[2], 0, m[3], m[4], m[5], 0,
                          m[6], m[7], m[8], 0, 0,    0,    0,    1};
  auto transform = ocio::MatrixTransform::Create();
  transform->setMatrix(m44);
  return transform;
}

// One value for each half float: exact at those, and within 1e-6 between them. Formulas of the
// library derive other constants near black.
ocio::Lut1DTransformRcPtr MakeCurve(double (*curve)(double)) {
  constexpr unsigned long kHalves = 65536;
  auto lut = ocio::Lut1DTransform::Create(kHalves, true);
  lut->setFileOutputBitDepth(ocio::BIT_DEPTH_F32);
  for (unsigned long i = 0; i < kHalves; ++i) {
    const double x = static_cast<double>(HalfToFloat(static_cast<uint16_t>(i)));
    const auto y = static_cast<float>(std::isfinite(x) ? curve(x) : x);
    lut->setValue(i, y, y, y);
  }
  return lut;
}

ocio::ConstConfigRcPtr MakeBuiltin() {
  const auto config = ocio::Config::Create()->createEditableCopy();
  config->setVersion(2, 1);
  const auto add = [&](const char* name, std::initializer_list<const char*> aliases,
                       const ocio::ConstTransformRcPtr& to_reference,
                       const ocio::ConstTransformRcPtr& from_reference) {
    auto space = ocio::ColorSpace::Create();
    space->setName(name);
    for (const char* alias : aliases) space->addAlias(alias);
    if (to_reference) space->setTransform(to_reference, ocio::COLORSPACE_DIR_TO_REFERENCE);
    if (from_reference) space->setTransform(from_reference, ocio::COLORSPACE_DIR_FROM_REFERENCE);
    config->addColorSpace(space);
  };
  const auto chain = [](std::initializer_list<ocio::ConstTransformRcPtr> parts) {
    auto group = ocio::GroupTransform::Create();
    for (const auto& part : parts) group->appendTransform(part->createEditableCopy());
    return group;
  };
  const auto from_rec709 = MakeMatrix(*ConversionMatrix(kRec709Primaries, kAp0Primaries));
  const auto to_rec709 = MakeMatrix(*ConversionMatrix(kAp0Primaries, kRec709Primaries));
  add("ACES2065-1", {"aces2065_1", "lin_ap0"}, nullptr, nullptr);
  add("ACEScg", {"lin_ap1"}, MakeMatrix(*ConversionMatrix(kAp1Primaries, kAp0Primaries)),
      MakeMatrix(*ConversionMatrix(kAp0Primaries, kAp1Primaries)));
  add("lin_rec709", {"Linear Rec.709 (sRGB)", "lin_srgb"}, from_rec709, to_rec709);
  add("sRGB", {"srgb_texture", "sRGB - Texture"}, chain({MakeCurve(SrgbToLinear), from_rec709}),
      chain({to_rec709, MakeCurve(LinearToSrgb)}));
  add("Rec.709", {"rec709"}, chain({MakeCurve(Rec709ToLinear), from_rec709}),
      chain({to_rec709, MakeCurve(LinearToRec709)}));
  auto raw = ocio::ColorSpace::Create();
  raw->setName("raw");
  raw->addAlias("data");
  raw->setIsData(true);
  config->addColorSpace(raw);
  config->setRole("aces_interchange", "ACES2065-1");
  config->setRole("scene_linear", "lin_rec709");
  config->setRole("default", "raw");
  return config;
}

// Every file that a transform names, in itself and in what it is made of.
void CollectFiles(const ocio::ConstTransformRcPtr& transform, std::set<std::string>* files) {
  if (!transform) return;
  if (const auto file = ocio::DynamicPtrCast<const ocio::FileTransform>(transform)) {
    files->insert(file->getSrc());
  } else if (const auto group = ocio::DynamicPtrCast<const ocio::GroupTransform>(transform)) {
    for (int i = 0; i < group->getNumTransforms(); ++i) CollectFiles(group->getTransform(i), files);
  }
}

std::set<std::string> FilesOf(const ocio::ConstConfigRcPtr& config) {
  std::set<std::string> files;
  const int spaces =
      config->getNumColorSpaces(ocio::SEARCH_REFERENCE_SPACE_ALL, ocio::COLORSPACE_ALL);
  for (int i = 0; i < spaces; ++i) {
    const auto space = config->getColorSpace(config->getColorSpaceNameByIndex(
        ocio::SEARCH_REFERENCE_SPACE_ALL, ocio::COLORSPACE_ALL, i));
    if (!space) continue;
    CollectFiles(space->getTransform(ocio::COLORSPACE_DIR_TO_REFERENCE), &files);
    CollectFiles(space->getTransform(ocio::COLORSPACE_DIR_FROM_REFERENCE), &files);
  }
  for (int i = 0; i < config->getNumLooks(); ++i) {
    const auto look = config->getLook(config->getLookNameByIndex(i));
    CollectFiles(look->getTransform(), &files);
    CollectFiles(look->getInverseTransform(), &files);
  }
  for (int i = 0; i < config->getNumViewTransforms(); ++i) {
    const auto view = config->getViewTransform(config->getViewTransformNameByIndex(i));
    CollectFiles(view->getTransform(ocio::VIEWTRANSFORM_DIR_TO_REFERENCE), &files);
    CollectFiles(view->getTransform(ocio::VIEWTRANSFORM_DIR_FROM_REFERENCE), &files);
  }
  return files;
}

// Of the text and the tables. A table that is not there is one that nothing can be read from; who
// uses it gets the error.
Result<std::string> HashConfig(const std::string& path, const std::string& text,
                               const ocio::ConstConfigRcPtr& config) {
  Sha256 hash;
  hash.Update("patina ocio config\n" + Sha256Hex(text) + "\n");
  const auto context = config->getCurrentContext();
  for (const std::string& name : FilesOf(config)) {
    std::string found;
    try {
      found = context->resolveFileLocation(name.c_str());
    } catch (const ocio::Exception&) {
      hash.Update("missing " + Sha256Hex(name) + "\n");
      continue;
    }
    std::error_code error;
    if (!std::filesystem::is_regular_file(found, error)) {
      return Fail(ErrorCode::kCorruptData,
                  path + ": it refers to " + found + ", which is not a regular file; correct it");
    }
    const uint64_t bytes = std::filesystem::file_size(found, error);
    if (error || bytes > kMaxColorLutBytes) {
      return Fail(ErrorCode::kOutOfRange, path + ": the table " + found + " is larger than " +
                                              std::to_string(kMaxColorLutBytes) +
                                              " bytes; use a smaller one");
    }
    auto digest = Sha256OfFile(found);
    if (!digest) return Fail(std::move(digest).error(), path);
    hash.Update("table " + Sha256Hex(name) + " " + digest->sha256 + "\n");
  }
  return hash.FinishHex();
}

// Names that a file may have for a working space. Believed only where the colours agree, or, where
// nothing can be compared, because they are unambiguous.
std::vector<const char*> CustomaryNames(WorkingSpace working) {
  if (working == WorkingSpace::kAcesCg)
    return {"ACEScg", "ACES - ACEScg", "lin_ap1", "Linear ACEScg"};
  return {"lin_rec709", "Linear Rec.709 (sRGB)", "Utility - Linear - sRGB", "Linear Rec.709",
          "lin_srgb",   "lin_rec709_srgb"};
}

std::string Interchange(const ocio::ConstConfigRcPtr& config) {
  for (const char* name : {"aces_interchange", "ACES2065-1", "ACES - ACES2065-1", "aces2065_1"}) {
    if (const auto space = config->getColorSpace(name)) return space->getName();
  }
  return "";
}

ocio::ConstTransformRcPtr Between(const std::string& from, const std::string& to) {
  auto transform = ocio::ColorSpaceTransform::Create();
  transform->setSrc(from.c_str());
  transform->setDst(to.c_str());
  return transform;
}

// Whether a space is linear light of these primaries.
bool ActsAs(const ocio::ConstConfigRcPtr& config, const std::string& space,
            const std::string& interchange, const Matrix3& to_ap0) {
  try {
    const ColorTransformPtr transform = MakeTransform(config, Between(space, interchange));
    float r[5] = {1, 0, 0, 0.25f, 1}, g[5] = {0, 1, 0, 0.25f, 1}, b[5] = {0, 0, 1, 0.25f, 1};
    const std::array<std::array<double, 3>, 5> in{
        {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {0.25, 0.25, 0.25}, {1, 1, 1}}};
    transform->Apply(r, g, b, 5);
    for (size_t i = 0; i < in.size(); ++i) {
      const float got[3] = {r[i], g[i], b[i]};
      for (size_t c = 0; c < 3; ++c) {
        const double wanted =
            to_ap0[3 * c] * in[i][0] + to_ap0[3 * c + 1] * in[i][1] + to_ap0[3 * c + 2] * in[i][2];
        if (!(std::fabs(static_cast<double>(got[c]) - wanted) <= kSameSpace)) return false;
      }
    }
    return true;
  } catch (const ocio::Exception&) {
    return false;  // of a table that is missing, say; another space may do
  }
}

// How the working space is reached in a configuration.
struct WorkingPlace {
  std::string space;  // the working space itself, or ACES2065-1 with a matrix to it
  bool through_ap0 = false;
};

Result<WorkingPlace> FindWorking(const ocio::ConstConfigRcPtr& config, WorkingSpace working,
                                 const std::string& context) {
  const std::string interchange = Interchange(config);
  const Matrix3 to_ap0 = *ConversionMatrix(PrimariesOf(working), kAp0Primaries);
  std::vector<const char*> names = CustomaryNames(working);
  if (!interchange.empty()) names.insert(names.begin(), {"scene_linear", "rendering"});
  for (const char* name : names) {
    const auto space = config->getColorSpace(name);
    if (!space || space->isData()) continue;
    if (interchange.empty() || ActsAs(config, space->getName(), interchange, to_ap0))
      return WorkingPlace{space->getName(), false};
  }
  if (!interchange.empty()) return WorkingPlace{interchange, true};
  return Fail(ErrorCode::kInvalidArgument,
              context + ": it has no role aces_interchange and no space that is " +
                  WorkingSpaceName(working) +
                  " by name, so its spaces cannot be related to the working space; add the role, "
                  "with its ACES2065-1 space");
}

}  // namespace

const char* ConfigSourceName(ConfigSource source) {
  switch (source) {
    case ConfigSource::kBuiltin:
      return "builtin";
    case ConfigSource::kEnvironment:
      return "environment";
    case ConfigSource::kFile:
      return "file";
  }
  return "builtin";
}

struct ColorConfig::Data {
  ConfigSource source = ConfigSource::kBuiltin;
  std::string file;
  std::string sha256;
  ocio::ConstConfigRcPtr config;

  std::string context() const {
    return file.empty() ? "the built-in colour configuration" : "colour configuration " + file;
  }
};

ColorConfig ColorConfig::Builtin() {
  static const std::shared_ptr<const Data> data = [] {
    auto made = std::make_shared<Data>();
    made->config = MakeBuiltin();
    made->sha256 = Sha256Hex(kBuiltinText);
    return made;
  }();
  return ColorConfig(data);
}

Result<ColorConfig> ColorConfig::Load(const std::string& file) {
  auto data = std::make_shared<Data>();
  data->file = file;
  data->source = ConfigSource::kFile;
  if (file.empty()) {
    const char* named = std::getenv("OCIO");
    if (named == nullptr || *named == '\0') return Builtin();
    data->file = named;
    data->source = ConfigSource::kEnvironment;
  }
  const std::string context =
      data->context() + (data->source == ConfigSource::kEnvironment ? " (of $OCIO)" : "");
  auto text = ReadTextFile(data->file, kMaxColorConfigBytes);
  if (!text) return Fail(std::move(text).error(), context);
  // Warnings of the library would go to standard error, between our own lines.
  ocio::SetLoggingLevel(ocio::LOGGING_LEVEL_NONE);
  const std::string remedy = "name a whole OpenColorIO configuration (config.ocio)";
  return Guarded(context, ErrorCode::kCorruptData, remedy, [&]() -> Result<ColorConfig> {
    std::istringstream stream(*text);
    const auto config = ocio::Config::CreateFromStream(stream)->createEditableCopy();
    const std::filesystem::path folder = std::filesystem::absolute(data->file).parent_path();
    config->setWorkingDir(folder.c_str());
    if (config->getNumColorSpaces() == 0)
      return Fail(ErrorCode::kCorruptData, context + ": it has no colour spaces; " + remedy);
    data->config = config;
    PATINA_ASSIGN(data->sha256, HashConfig(context, *text, data->config));
    return ColorConfig(data);
  });
}

ConfigSource ColorConfig::source() const { return data_->source; }
const std::string& ColorConfig::file() const { return data_->file; }
const std::string& ColorConfig::sha256() const { return data_->sha256; }

std::vector<ConfigSpace> ColorConfig::Spaces() const {
  std::vector<ConfigSpace> spaces;
  const ocio::ConstConfigRcPtr& config = data_->config;
  for (int i = 0; i < config->getNumColorSpaces(); ++i) {
    const auto space = config->getColorSpace(config->getColorSpaceNameByIndex(i));
    if (space) spaces.push_back({space->getName(), space->isData()});
  }
  return spaces;
}

Result<ConfigSpace> ColorConfig::Find(const std::string& name) const {
  // The library compares C strings.
  if (name.find('\0') == std::string::npos) {
    if (const auto space = data_->config->getColorSpace(name.c_str()))
      return ConfigSpace{space->getName(), space->isData()};
  }
  std::multimap<size_t, std::string> nearest;
  const std::string wanted = Lower(name.substr(0, 255));
  for (const ConfigSpace& space : Spaces()) {
    size_t distance = EditDistance(wanted, Lower(space.name));
    const auto known = data_->config->getColorSpace(space.name.c_str());
    for (size_t i = 0; i < known->getNumAliases(); ++i)
      distance = std::min(distance, EditDistance(wanted, Lower(known->getAlias(i))));
    nearest.emplace(distance, space.name);
  }
  std::string list;
  size_t shown = 0;
  for (const auto& [distance, candidate] : nearest) {
    if (++shown > kShownNames) break;
    list += (list.empty() ? "" : ", ") + candidate;
  }
  return Fail(ErrorCode::kInvalidArgument, QuoteForMessage(name) + " is no colour space of " +
                                               data_->context() + "; the nearest names are " +
                                               list);
}

std::optional<ConfigSpace> ColorConfig::FileRule(const std::string& path) const {
  try {
    size_t rule = 0;
    const char* name = data_->config->getColorSpaceFromFilepath(path.c_str(), rule);
    const size_t rules = data_->config->getFileRules()->getNumEntries();
    if (name == nullptr || rule + 1 >= rules) return std::nullopt;
    const auto space = data_->config->getColorSpace(name);
    if (!space) return std::nullopt;
    return ConfigSpace{space->getName(), space->isData()};
  } catch (const std::exception&) {
    return std::nullopt;  // a pattern that the library cannot follow matches nothing
  }
}

Result<ColorTransformPtr> ColorConfig::Convert(const ConfigSpace& space, WorkingSpace working,
                                               bool to_working) const {
  const std::string context = data_->context() + ": " + QuoteForMessage(space.name);
  return Guarded(
      context, ErrorCode::kCorruptData, "correct the configuration or its tables",
      [&]() -> Result<ColorTransformPtr> {
        const ocio::ConstConfigRcPtr& config = data_->config;
        PATINA_ASSIGN(const WorkingPlace place, FindWorking(config, working, data_->context()));
        auto group = ocio::GroupTransform::Create();
        const Primaries& primaries = PrimariesOf(working);
        if (to_working) {
          group->appendTransform(Between(space.name, place.space)->createEditableCopy());
          if (place.through_ap0)
            group->appendTransform(MakeMatrix(*ConversionMatrix(kAp0Primaries, primaries)));
        } else {
          if (place.through_ap0)
            group->appendTransform(MakeMatrix(*ConversionMatrix(primaries, kAp0Primaries)));
          group->appendTransform(Between(place.space, space.name)->createEditableCopy());
        }
        return MakeTransform(config, group);
      });
}

Result<ColorTransformPtr> ColorConfig::ToWorking(const ConfigSpace& space,
                                                 WorkingSpace working) const {
  return Convert(space, working, true);
}

Result<ColorTransformPtr> ColorConfig::FromWorking(const ConfigSpace& space,
                                                   WorkingSpace working) const {
  return Convert(space, working, false);
}

}  // namespace patina
