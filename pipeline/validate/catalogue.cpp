// The catalogue of findings. FINDINGS.md is made of it: `patina validate --list-codes`.
#include <algorithm>
#include <array>

#include "formats/base/check.h"
#include "pipeline/validate/findings.h"

namespace patina::validate {
namespace {

constexpr Severity kE = Severity::kError;
constexpr Severity kW = Severity::kWarning;
constexpr Severity kN = Severity::kNote;

constexpr const char* kBakeOrCopy =
    "Bake the asset again, or copy the file again from a good place.";
constexpr const char* kNewer = "Use a newer patina, or bake the asset with this one.";
constexpr const char* kBake = "Bake the asset again.";

constexpr FindingKind kCatalogue[] = {
    {1001, kE, "manifest-missing", "A folder named as a container has no manifest.json.",
     "Name the folder of a revision or of an asset; if the manifest was lost, bake again."},
    {1002, kE, "manifest-not-json",
     "manifest.json is not JSON, or larger or deeper than any manifest.", kBakeOrCopy},
    {1003, kE, "manifest-newer",
     "The manifest is of a format, version or kind that this program does not read.", kNewer},
    {1004, kE, "manifest-schema", "The manifest breaks schemas/manifest.schema.json.", kBakeOrCopy},
    {1005, kE, "manifest-rule",
     "The manifest contradicts itself: a rule of FORMATS.md beyond the schema.", kBakeOrCopy},
    {1006, kN, "manifest-unknown-member",
     "The manifest has a member that this version does not know.",
     "Look for a typing error; ignore it if a newer version wrote the container."},
    {1007, kE, "manifest-version",
     "format_version is not the lowest one whose readers decode the container rightly.", kBake},
    {1008, kE, "manifest-repeated-key", "A key stands twice in one object of the manifest.",
     kBakeOrCopy},
    {1101, kE, "payload-missing",
     "A file that the manifest lists is not there, or is no regular file.", kBakeOrCopy},
    {1102, kE, "payload-size", "A file has not the size that the manifest lists.", kBakeOrCopy},
    {1103, kE, "payload-checksum", "A file has not the SHA-256 that the manifest lists.",
     kBakeOrCopy},
    {1104, kW, "file-unlisted", "A file in the container is not listed in its manifest.",
     "Remove it: containers never change once they are published."},
    {1105, kW, "entry-not-a-file", "The container holds a folder, a link or a device.",
     "Remove it: containers hold regular files only."},
    {1106, kW, "payload-unused",
     "Nothing in the manifest refers to a payload of a role that decoding needs.", kBake},
    {1107, kE, "codebook-missing", "The codebook that a BRDF shares with others is not there.",
     "Copy it to the folder that holds the assets, or into the container."},
    {1108, kE, "codebook-checksum",
     "The shared codebook is not the one that the BRDF was made with.",
     "Copy the container and its codebook again, together."},
    {1201, kE, "current-dangling", "`current` of an asset does not point at a revision.",
     "Point it at a good revision, or bake again."},
    {1202, kN, "current-not-newest", "`current` does not point at the newest revision.",
     "Nothing, if somebody went back on purpose."},
    {1203, kE, "current-not-a-link", "`current` of an asset is not a symbolic link.",
     "Move it away and bake again."},
    {1204, kN, "staging-left", "A bake of this asset is going on, or was killed.",
     "Nothing: the next bake of the asset removes it."},
    {1205, kW, "asset-name",
     "The manifest names another asset than the folder that holds the revision.",
     "Give the folder its name back, or bake under the new name."},
    {1206, kN, "rejected-kept",
     "A container that missed its quality gate is kept beside the revisions.",
     "Look at it; the next bake that misses the gate replaces it."},
    {1301, kW, "constant-out-of-range", "A constant channel has a value outside its own range.",
     kBake},
    {1302, kE, "effects-contradict-channels",
     "What `effects` says of a channel or of mips is not what the container holds.", kBake},
    {1303, kE, "lod-bias",
     "A feature texture's size does not go with its lod_bias and the source's size.", kBake},
    {1304, kW, "curve-order",
     "The training curve does not rise, or goes beyond the samples of the training.", kBake},
    {1305, kW, "quality-map",
     "The quality names a map that the container does not have, or leaves one out.", kBake},
    {1306, kW, "map-role",
     "`maps` or a source file names a role that no channel has, or `maps` leaves one out.", kBake},
    {1401, kW, "input-changed", "An input file is not the one that the container was baked from.",
     "Bake the asset again, or bring the file back."},
    {1402, kN, "input-missing", "An input file that the manifest lists is not in the given folder.",
     "Name the folder that the container was baked from."},

    {2001, kE, "dds-magic", "A feature texture does not begin like a DDS file.", kBakeOrCopy},
    {2002, kE, "dds-header", "A field of a DDS header has an impossible value.", kBakeOrCopy},
    {2003, kE, "dds-unsupported",
     "A feature texture is neither a BC6H nor an RGBA16F texture with a DX10 header.",
     "Write it as one of these with a DX10 header, as `patina bake` does."},
    {2004, kE, "dds-truncated", "A feature texture ends too early.", kBakeOrCopy},
    {2005, kE, "dds-trailing", "There are bytes behind the last level of a feature texture.",
     kBakeOrCopy},
    {2006, kE, "dds-manifest",
     "Size, levels or format of a feature texture are not those of the manifest.", kBake},
    {2007, kW, "dds-not-canonical",
     "What decoders pass over (flags, pitch, caps and reserved fields of the header; alpha) is not "
     "what FORMATS.md says.",
     "Write it as FORMATS.md says; some engines look at these fields."},
    {2101, kE, "bc6h-reserved-mode", "A BC6H block has a reserved mode and decodes to zeros.",
     kBakeOrCopy},
    {2102, kE, "bc6h-not-finite", "A BC6H block decodes to a value that is not finite.",
     kBakeOrCopy},
    {2103, kE, "halves-not-finite", "A texel of an RGBA16F texture is infinite or not a number.",
     kBakeOrCopy},

    {3001, kE, "weights-magic", "The weights do not begin with PATINAWT.", kBakeOrCopy},
    {3002, kE, "weights-header", "A field of the weights' header has an impossible value.",
     kBakeOrCopy},
    {3003, kE, "weights-newer",
     "The weights are of a version or element type that this program does not read.", kNewer},
    {3004, kE, "weights-truncated", "The weights end too early.", kBakeOrCopy},
    {3005, kE, "weights-trailing", "There are bytes behind the end of the weights.", kBakeOrCopy},
    {3006, kE, "weights-crc", "The checksum within the weights does not match.", kBakeOrCopy},
    {3007, kE, "weights-tensor", "An entry in the table of tensors is wrong.", kBakeOrCopy},
    {3008, kE, "weights-not-finite", "A weight is infinite or not a number.", kBake},
    {3009, kE, "weights-manifest",
     "The shapes of the tensors are not those of the network in the manifest.", kBake},
    {3010, kW, "weights-not-canonical", "Reserved bytes of the weights are not 0.", kBakeOrCopy},

    {4001, kE, "grid-magic", "An index pack or codebook begins with the wrong bytes.", kBakeOrCopy},
    {4002, kE, "grid-header",
     "A field of the header of an index pack or codebook has an impossible value.", kBakeOrCopy},
    {4003, kE, "grid-newer",
     "The index pack or codebook is of a version that this program does not read.", kNewer},
    {4004, kE, "grid-truncated", "The index pack or codebook ends too early.", kBakeOrCopy},
    {4005, kE, "grid-trailing", "There are bytes behind the end of the index pack or codebook.",
     kBakeOrCopy},
    {4006, kE, "grid-crc", "The checksum within the index pack or codebook does not match.",
     kBakeOrCopy},
    {4007, kE, "grid-map", "The map of stored corners does not fit the grid.", kBakeOrCopy},
    {4008, kE, "grid-index", "An index is beyond the codebook.", kBakeOrCopy},
    {4009, kE, "grid-codebook", "The index pack and its codebook do not belong together.",
     kBakeOrCopy},
    {4010, kE, "grid-not-finite", "A value of the codebook is infinite or not a number.", kBake},
    {4011, kE, "grid-zstd",
     "The zstd frame around an index pack or codebook is damaged or too large.", kBakeOrCopy},
    {4012, kE, "grid-manifest", "The index pack's header is not what the manifest repeats of it.",
     kBake},
    {4013, kW, "grid-not-canonical",
     "The index pack or codebook is not written as `patina` writes it.", kBakeOrCopy},
    {4101, kE, "sampler-magic", "The sampler does not begin with PATINASM.", kBakeOrCopy},
    {4102, kE, "sampler-header", "A field of the sampler's header has an impossible value.",
     kBakeOrCopy},
    {4103, kE, "sampler-newer", "The sampler is of a version that this program does not read.",
     kNewer},
    {4104, kE, "sampler-truncated", "The sampler ends too early.", kBakeOrCopy},
    {4105, kE, "sampler-trailing", "There are bytes behind the end of the sampler.", kBakeOrCopy},
    {4106, kE, "sampler-crc", "The checksum within the sampler does not match.", kBakeOrCopy},
    {4107, kE, "sampler-table", "The sampler has a bin that nothing can be drawn from.", kBake},
    {4108, kW, "sampler-not-canonical", "Reserved bytes of the sampler are not 0.", kBakeOrCopy},

    {5001, kE, "document-not-json", "A document is not JSON, or too deep or too large.",
     "Correct the text where the message says."},
    {5002, kE, "job-problem", "A job file has a field that is wrong, missing or not known.",
     "Correct the field; schemas/job.schema.json lists them all."},
    {5003, kE, "job-newer", "A job file is of a newer version.", kNewer},
    {5004, kW, "job-input-missing", "A file or folder that a job names is not there.",
     "Correct the path; it is relative to the folder of the job file."},
    {5101, kE, "config-problem", "A configuration of patinad breaks schemas/config.schema.json.",
     "Correct the field; `patinad --check-config` tells more on the machine itself."},
    {5201, kE, "scene-problem", "A scene file cannot be read as a whole.",
     "Correct it; schemas/scene.schema.json describes *.patina.json."},
    {5202, kE, "scene-schema", "A scene file breaks schemas/scene.schema.json.",
     "Correct the field where the JSON pointer says."},
    {5203, kW, "scene-material", "A material or image of a scene cannot be baked.",
     "Correct it, or bring the missing file."},
    {5301, kE, "scene-manifest-schema",
     "The description of a baked scene breaks schemas/scene-manifest.schema.json.",
     "Bake the scene again."},
    {5302, kE, "scene-container-missing", "A baked scene names a container that is not there.",
     "Bake the scene again, or copy all of its containers."},
    {5303, kE, "scene-container-differs",
     "What a baked scene says of a container is not what that container's manifest says.",
     "Bake the scene again."},
    {5304, kW, "scene-bake-failed", "The last bake of a material of the scene failed.",
     "See the problem in the message, correct it, and bake again."},
    {5401, kE, "bindings-schema", "bindings.json breaks schemas/bindings.schema.json.",
     "Run `patina shader` again."},
    {5402, kE, "bindings-file",
     "A file that bindings.json names is missing, or not the one it was written with.",
     "Run `patina shader` again."},

    {6001, kE, "gate-missed", "The container did not meet its quality gate.",
     "Bake with a higher --quality or a larger --profile, or lower the gate."},
    {6002, kN, "gate-absent", "No quality gate is recorded.",
     "Bake with --min-psnr if a quality is required."},
    {6003, kE, "gate-contradiction",
     "Whether the gate was met is not what the recorded quality and gate amount to.", kBake},
    {6101, kE, "quality-differs", "The quality measured from the files is not the recorded one.",
     "Bake again; if the source has changed, that is the reason."},
    {6102, kE, "quality-not-measured", "The container cannot be measured against the given source.",
     "Name the folder or job that it was baked from."},

    {7001, kE, "archive-magic", "The file does not begin like an archive of `patina pack`.",
     "Pack the container again."},
    {7002, kE, "archive-header", "A field of the archive has an impossible value.",
     "Copy or pack it again."},
    {7003, kE, "archive-newer", "The archive is of a version that this program does not read.",
     kNewer},
    {7004, kE, "archive-truncated", "The archive ends too early.", "Copy or pack it again."},
    {7005, kE, "archive-trailing", "There are bytes behind the end of the archive.",
     "Copy or pack it again."},
    {7006, kE, "archive-index", "The index at the end of the archive is damaged.",
     "Copy or pack it again."},
    {7007, kE, "archive-name",
     "A member has a name that cannot be a file of a container, or stands twice.",
     "Do not unpack it: `patina pack` writes no such archives."},
    {7008, kE, "archive-member",
     "A member is damaged, or not of the size or SHA-256 that the archive states.",
     "Copy or pack it again."},

    {9001, kE, "not-found",
     "There is no such file or folder, or nothing in it that can be validated.",
     "Correct the path."},
    {9002, kE, "cannot-read",
     "The operating system does not let a file be read, or it is too large.",
     "Check permissions, memory and the disk."},
    {9003, kE, "unknown-kind", "The file is none of those that can be validated.",
     "Name containers, archives, jobs, configurations, scenes, *.scene.json or bindings.json."},
};

constexpr std::array<const char*, 10> kGroups = {"",
                                                 "Containers and manifests",
                                                 "Feature textures",
                                                 "Weights",
                                                 "Index packs and samplers",
                                                 "Documents",
                                                 "Quality",
                                                 "Archives",
                                                 "",
                                                 "What cannot be read"};

}  // namespace

std::span<const FindingKind> Catalogue() { return kCatalogue; }

const FindingKind& KindOf(int number) {
  const auto found =
      std::lower_bound(std::begin(kCatalogue), std::end(kCatalogue), number,
                       [](const FindingKind& kind, int value) { return kind.number < value; });
  PATINA_CHECK(found != std::end(kCatalogue) && found->number == number);
  return *found;
}

std::string CodeText(int number) { return "PAT-" + std::to_string(number); }

std::optional<int> ParseCode(std::string_view text) {
  for (const FindingKind& kind : kCatalogue) {
    if (text == CodeText(kind.number)) return kind.number;
  }
  return std::nullopt;
}

std::string CatalogueText() {
  std::string text =
      "# Findings of `patina validate`\n\n"
      "`patina validate --list-codes` prints this page. A code keeps its meaning for ever; "
      "`--severity CODE=error|warning|note|off`\nor a file for `--config` gives it another "
      "severity.\n";
  int group = 0;
  for (const FindingKind& kind : kCatalogue) {
    if (kind.number / 1000 != group) {
      group = kind.number / 1000;
      text += "\n## " + std::to_string(group) + "xxx: " + kGroups[static_cast<size_t>(group)] +
              "\n\n| code | severity | name | meaning | remedy |\n|---|---|---|---|---|\n";
    }
    text += "| " + CodeText(kind.number) + " | " + SeverityName(kind.severity) + " | " + kind.name +
            " | " + kind.meaning + " | " + kind.remedy + " |\n";
  }
  return text;
}

}  // namespace patina::validate
