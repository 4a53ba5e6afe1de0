#include "pipeline/image/map_roles.h"

#include <array>
#include <map>
#include <utility>

namespace patina {
namespace {

const std::array<const char*, 6> kNormalWords = {"normal", "normals", "nor", "nrm", "norm", "nml"};
const std::array<const char*, 3> kClearcoatNormalWords = {"clearcoatnormal", "coatnormal",
                                                          "clearcoatnrm"};

class TokenTable {
 public:
  TokenTable() {
    AddColors();
    AddNormals();
    AddScalars();
    AddExtensions();
    AddPacked();
  }
  const MapToken* Find(std::string_view name) const {
    const auto found = tokens_.find(name);
    return found == tokens_.end() ? nullptr : &found->second;
  }

 private:
  MapToken& Add(std::string name, std::vector<TokenPart> parts, int rank = kOwnFileRank) {
    MapToken& token = tokens_[name];
    token.name = std::move(name);
    token.parts = std::move(parts);
    token.rank = rank;
    return token;
  }
  void AddScalar(const char* role, std::initializer_list<const char*> names,
                 int rank = kOwnFileRank, bool invert = false) {
    for (const char* name : names) Add(name, {{role, "", invert}}, rank);
  }
  void AddWeak(const char* role, std::initializer_list<const char*> names) {
    for (const char* name : names) Add(name, {{role, ""}}, kStandInRank).weak = true;
  }

  void AddColors() {
    const std::vector<TokenPart> with_alpha = {{"albedo", "rgb"}, {"opacity", "a", false, true}};
    for (const char* name : {"albedo",
                             "alb",
                             "basecolor",
                             "basecolour",
                             "basecol",
                             "diffuse",
                             "diff",
                             "dif",
                             "diffusecolor",
                             "diffusecolour",
                             "col",
                             "color",
                             "colour",
                             "bc",
                             "basemap",
                             "albedoalpha",
                             "albedotransparency",
                             "albedoopacity",
                             "basecoloralpha",
                             "basecoloropacity",
                             "basecolortransparency",
                             "diffusealpha",
                             "diffuseopacity",
                             "diffusetransparency",
                             "coloralpha",
                             "coloropacity",
                             "bca",
                             "da"}) {
      Add(name, with_alpha);
    }
    for (const char* name : {"d", "base"}) Add(name, with_alpha, kStandInRank).weak = true;
    for (const char* name : {"emissive", "emission", "emissivecolor", "emissioncolor", "emit",
                             "emis", "emm", "selfillum", "selfillumination", "incandescence"}) {
      Add(name, {{"emissive", "rgb"}});
    }
    for (const char* name : {"e", "em", "glow"})
      Add(name, {{"emissive", "rgb"}}, kStandInRank).weak = true;
  }

  void AddNormals() {
    const std::array<std::pair<const char*, NormalConvention>, 7> suffixes = {{
        {"", NormalConvention::kAuto},
        {"gl", NormalConvention::kOpenGl},
        {"ogl", NormalConvention::kOpenGl},
        {"opengl", NormalConvention::kOpenGl},
        {"dx", NormalConvention::kDirectX},
        {"d3d", NormalConvention::kDirectX},
        {"directx", NormalConvention::kDirectX},
    }};
    for (const auto& [suffix, convention] : suffixes) {
      for (const char* word : kNormalWords) {
        Add(std::string(word) + suffix, {{"normal", ""}}).convention = convention;
      }
      for (const char* word : kClearcoatNormalWords) {
        Add(std::string(word) + suffix, {{"clearcoat_normal", ""}}).convention = convention;
      }
    }
    AddWeak("normal", {"n"});
  }

  void AddScalars() {
    AddScalar("ao", {"ao", "ambientocclusion", "ambientocc", "occlusion", "occ", "ambient",
                     "mixedao", "aomap"});
    AddScalar("roughness", {"roughness", "rgh"});
    AddWeak("roughness", {"r"});
    Add("rough", {{"roughness", ""}}).weak = true;
    AddScalar("roughness", {"gloss", "glossiness", "smoothness"}, kStandInRank, true);
    AddScalar("metalness", {"metallic", "metalness", "metallness", "mtl", "metalic"});
    Add("metal", {{"metalness", ""}}).weak = true;
    AddWeak("metalness", {"m"});
    AddScalar("displacement", {"displacement", "disp", "displ", "height", "heightmap", "hgt"});
    AddScalar("displacement", {"bump", "bumpmap"}, kStandInRank);
    AddWeak("displacement", {"h"});
    AddScalar("opacity",
              {"opacity", "alpha", "transparency", "cutout", "opacitymask", "alphamask"});
    Add("mask", {{"opacity", ""}}, kStandInRank).weak = true;
    AddScalar("cavity", {"cavity", "cav"});
    AddScalar("curvature", {"curvature", "curv"});
  }

  // A scalar in a file of one channel, a colour in one of three.
  void AddScalarOrColor(const char* scalar, const char* color,
                        std::initializer_list<const char*> names) {
    for (const char* name : names) Add(name, {{scalar, ""}}).wide_parts = {{color, "rgb"}};
  }

  void AddExtensions() {
    AddScalarOrColor("specular", "specular_color",
                     {"specular", "spec", "reflection", "refl", "specularf0", "f0"});
    AddScalar("specular", {"specularlevel", "specularfactor"});
    AddWeak("specular", {"s"});
    for (const char* name : {"specularcolor", "specularcolour", "spccolor"}) {
      Add(name, {{"specular_color", "rgb"}, {"specular", "a", false, true}});
    }
    AddScalar("clearcoat", {"clearcoat", "clearcoatfactor", "clearcoatweight", "clearcoatmask"});
    AddScalar("clearcoat_roughness", {"clearcoatroughness", "clearcoatrough", "coatroughness"});
    for (const char* name : {"sheen", "fuzz"}) {
      Add(name, {{"sheen", ""}}).wide_parts = {{"sheen_color", "rgb"},
                                               {"sheen_roughness", "a", false, true}};
    }
    for (const char* name : {"sheencolor", "sheencolour", "sheentint"}) {
      Add(name, {{"sheen_color", "rgb"}, {"sheen_roughness", "a", false, true}});
    }
    AddScalar("sheen_roughness", {"sheenroughness", "sheenrough"});
    for (const char* name : {"anisotropy", "anisotropic", "aniso"}) {
      Add(name, {{"anisotropy", ""}}).wide_parts = {{"anisotropy_direction", "rg"},
                                                    {"anisotropy", "b"}};
    }
    AddScalar("anisotropy", {"anisotropylevel", "anisotropystrength", "anisotropymagnitude"});
    AddScalar("anisotropy_rotation",
              {"anisotropyangle", "anisotropyrotation", "anisoangle", "anisorotation"});
    AddScalar("transmission", {"transmission", "transmissive", "transmissionweight", "refraction"});
    AddScalar("thickness", {"thickness", "volumethickness"});
    AddScalarOrColor("subsurface", "subsurface_color",
                     {"subsurface", "scattering", "subsurfacescattering", "sss", "scatter",
                      "subsurfacecolor", "scatteringcolor"});
    AddScalarOrColor("translucency", "translucency_color", {"translucency", "translucent"});
    AddScalar("iridescence", {"iridescence", "iridescencemask"});
    AddScalar("iridescence_thickness", {"iridescencethickness"});
  }

  void AddPacked() {
    const TokenPart ao_r{"ao", "r"}, rough_g{"roughness", "g"}, metal_b{"metalness", "b"};
    for (const char* name :
         {"orm", "arm", "aorm", "occlusionroughnessmetallic", "occlusionroughnessmetalness",
          "occlusionroughnessmetal", "occlusionroughmetal", "occlusionroughmetallic",
          "aoroughnessmetallic", "aoroughnessmetalness", "aoroughmetal",
          "ambientocclusionroughnessmetallic"}) {
      Add(name, {ao_r, rough_g, metal_b}, kPackedRank);
    }
    for (const char* name : {"ormh", "armh", "armd"}) {
      Add(name, {ao_r, rough_g, metal_b, {"displacement", "a", false, true}}, kPackedRank);
    }
    Add("occlusionroughmetaltransmission",
        {ao_r, rough_g, metal_b, {"transmission", "a", false, true}}, kPackedRank);
    for (const char* name :
         {"rma", "rmao", "roughnessmetallicao", "roughnessmetalnessao", "roughmetalao",
          "roughnessmetallicocclusion", "roughnessmetallicambientocclusion"}) {
      Add(name, {{"roughness", "r"}, {"metalness", "g"}, {"ao", "b"}}, kPackedRank);
    }
    for (const char* name :
         {"mra", "mrao", "mro", "metallicroughnessao", "metalroughnessao", "metalroughao",
          "metalnessroughnessao", "metallicroughnessocclusion"}) {
      Add(name, {{"metalness", "r"}, {"roughness", "g"}, {"ao", "b"}}, kPackedRank);
    }
    for (const char* name : {"ord", "ordp", "occlusionroughnessdisplacement"}) {
      Add(name, {ao_r, rough_g, {"displacement", "b"}}, kPackedRank);
    }
    // glTF: roughness in G, metalness in B, R unused. A file of one channel is what its last word
    // says. No "metalroughness" here: in "rusty_metal_roughness" the metal belongs to the
    // material's name.
    for (const char* name : {"metallicroughness", "metalnessroughness"}) {
      Add(name, {{"roughness", "r"}}, kPackedRank).wide_parts = {rough_g, metal_b};
    }
    for (const char* name :
         {"metallicsmoothness", "metalsmoothness", "metallicgloss", "metallicglossiness"}) {
      Add(name, {{"metalness", "r"}, {"roughness", "a", true}}, kPackedRank);
    }
    for (const char* name :
         {"specularsmoothness", "specularglossiness", "speculargloss", "specgloss"}) {
      Add(name, {{"specular_color", "rgb"}, {"roughness", "a", true}}, kPackedRank);
    }
    for (const char* name : {"maskmap", "mads"}) {  // Unity HDRP; its B is a mask for detail maps
      Add(name, {{"metalness", "r"}, {"ao", "g"}, {"roughness", "a", true}}, kPackedRank);
    }
    // KHR_materials_transmission and KHR_materials_clearcoat both read R.
    for (const char* name : {"transmissionclearcoat", "clearcoattransmission"}) {
      Add(name, {{"clearcoat", "r"}, {"transmission", "r"}}, kPackedRank);
    }
    Add("clearcoatclearcoatroughness", {{"clearcoat", "r"}, {"clearcoat_roughness", "g"}},
        kPackedRank);
  }

  std::map<std::string, MapToken, std::less<>> tokens_;
};

const TokenTable& Tokens() {
  static const TokenTable table;
  return table;
}

}  // namespace

const char* NormalConventionName(NormalConvention convention) {
  switch (convention) {
    case NormalConvention::kAuto:
      return "auto";
    case NormalConvention::kOpenGl:
      return "opengl";
    case NormalConvention::kDirectX:
      return "directx";
  }
  return "auto";
}

std::optional<NormalConvention> ParseNormalConvention(std::string_view name) {
  if (name == "auto") return NormalConvention::kAuto;
  if (name == "opengl") return NormalConvention::kOpenGl;
  if (name == "directx") return NormalConvention::kDirectX;
  return std::nullopt;
}

const std::vector<MapRole>& MapRoles() {
  static const std::vector<MapRole> roles = {
      {"albedo", MapKind::kColor, 'r'},
      {"normal", MapKind::kNormal, 'r'},
      {"ao", MapKind::kScalar, 'r'},
      {"roughness", MapKind::kScalar, 'g'},
      {"metalness", MapKind::kScalar, 'b'},
      {"displacement", MapKind::kScalar, 'r'},
      {"emissive", MapKind::kColor, 'r'},
      {"opacity", MapKind::kScalar, 'a'},
      {"specular", MapKind::kScalar, 'a'},
      {"specular_color", MapKind::kColor, 'r'},
      {"clearcoat", MapKind::kScalar, 'r'},
      {"clearcoat_roughness", MapKind::kScalar, 'g'},
      {"clearcoat_normal", MapKind::kNormal, 'r'},
      {"sheen", MapKind::kScalar, 'r'},
      {"sheen_color", MapKind::kColor, 'r'},
      {"sheen_roughness", MapKind::kScalar, 'a'},
      {"anisotropy", MapKind::kScalar, 'b'},
      {"anisotropy_direction", MapKind::kVector2, 'r'},
      {"anisotropy_rotation", MapKind::kScalar, 'r'},
      {"transmission", MapKind::kScalar, 'r'},
      {"thickness", MapKind::kScalar, 'g'},
      {"subsurface", MapKind::kScalar, 'r'},
      {"subsurface_color", MapKind::kColor, 'r'},
      {"translucency", MapKind::kScalar, 'r'},
      {"translucency_color", MapKind::kColor, 'r'},
      {"iridescence", MapKind::kScalar, 'r'},
      {"iridescence_thickness", MapKind::kScalar, 'g'},
      {"cavity", MapKind::kScalar, 'r'},
      {"curvature", MapKind::kScalar, 'r'},
  };
  return roles;
}

const MapRole* FindMapRole(std::string_view name) {
  for (const MapRole& role : MapRoles()) {
    if (name == role.name) return &role;
  }
  return nullptr;
}

int MapRoleIndex(std::string_view name) {
  return static_cast<int>(FindMapRole(name) - MapRoles().data());
}

const MapToken* FindMapToken(std::string_view name) { return Tokens().Find(name); }

std::string KnownTokensText() {
  return "albedo, basecolor, diffuse, diff, col, color; normal, nor, nrm (+ _gl, _dx); ao, "
         "occlusion; roughness, rough; "
         "gloss, smoothness; metallic, metalness, metal; orm, arm, rma; displacement, disp, "
         "height; emissive, emission; "
         "opacity, alpha, mask; specular; clearcoat; sheen; anisotropy; transmission; thickness; "
         "subsurface, scattering";
}

}  // namespace patina
