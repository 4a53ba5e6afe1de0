#include "pipeline/image/map_name.h"

#include <gtest/gtest.h>

#include <ostream>
#include <string>

namespace patina {
namespace {

struct NameCase {
  const char* name;   // without extension
  const char* token;  // "" if none is recognised
  const char* stem;
  NormalConvention convention = NormalConvention::kAuto;
  int resolution = 0;
};
void PrintTo(const NameCase& c, std::ostream* out) { *out << c.name; }

class MapNames : public testing::TestWithParam<NameCase> {};

TEST_P(MapNames, AreReadAsTheirPublisherMeant) {
  const NameCase& expected = GetParam();
  const MapName name = ParseMapName(expected.name);
  EXPECT_EQ(name.token == nullptr ? "" : name.token->name, expected.token);
  EXPECT_EQ(name.stem, expected.stem);
  EXPECT_EQ(name.convention, expected.convention);
  EXPECT_EQ(name.resolution, expected.resolution);
}

constexpr auto kGl = NormalConvention::kOpenGl;
constexpr auto kDx = NormalConvention::kDirectX;
constexpr auto kNone = NormalConvention::kAuto;

INSTANTIATE_TEST_SUITE_P(
    PolyHaven, MapNames,
    testing::Values(NameCase{"metal_plate_02_diff_1k", "diff", "metal_plate_02", kNone, 1024},
                    NameCase{"metal_plate_02_nor_gl_1k", "norgl", "metal_plate_02", kGl, 1024},
                    NameCase{"metal_plate_02_nor_dx_4k", "nordx", "metal_plate_02", kDx, 4096},
                    NameCase{"metal_plate_02_arm_1k", "arm", "metal_plate_02", kNone, 1024},
                    NameCase{"rosewood_veneer1_rough_1k", "rough", "rosewood_veneer1", kNone, 1024},
                    NameCase{"cobblestone_floor_04_disp_16k", "disp", "cobblestone_floor_04", kNone,
                             16384},
                    NameCase{"rollershutter_window_02_graffiti_diff_2k", "diff",
                             "rollershutter_window_02_graffiti", kNone, 2048},
                    NameCase{"wood_floor_ao_8k", "ao", "wood_floor", kNone, 8192}));

INSTANTIATE_TEST_SUITE_P(
    AmbientCg, MapNames,
    testing::Values(NameCase{"Bricks102_1K-JPG_NormalGL", "normalgl", "Bricks102", kGl, 1024},
                    NameCase{"Bricks102_1K-JPG_NormalDX", "normaldx", "Bricks102", kDx, 1024},
                    NameCase{"Bricks102_1K-JPG_AmbientOcclusion", "ambientocclusion", "Bricks102",
                             kNone, 1024},
                    NameCase{"Rock020_1K_Color", "color", "Rock020", kNone, 1024},
                    NameCase{"Metal032_2K-PNG_Metalness", "metalness", "Metal032", kNone, 2048},
                    NameCase{"Rock020_1K_Displacement", "displacement", "Rock020", kNone, 1024},
                    NameCase{"Bricks102", "", ""}));

INSTANTIATE_TEST_SUITE_P(
    Substance, MapNames,
    testing::Values(
        NameCase{"BoomBox_baseColor", "basecolor", "BoomBox"},
        NameCase{"BoomBox_occlusionRoughnessMetallic", "occlusionroughnessmetallic", "BoomBox"},
        NameCase{"wall_Base_Color", "basecolor", "wall"},
        NameCase{"wall_Mixed_AO", "mixedao", "wall"},
        NameCase{"wall_Normal_OpenGL", "normalopengl", "wall", kGl},
        NameCase{"wall_Normal_DirectX", "normaldirectx", "wall", kDx},
        NameCase{"DefaultMaterial_Height", "height", "DefaultMaterial"},
        NameCase{"chair_Glossiness", "glossiness", "chair"},
        NameCase{"ToyCar_occlusion_roughness_metallic", "occlusionroughnessmetallic", "ToyCar"},
        NameCase{"wall_BaseColor.1001", "basecolor", "wall"},
        NameCase{"wall.normal.1002", "normal", "wall"}));

INSTANTIATE_TEST_SUITE_P(
    Quixel, MapNames,
    testing::Values(NameCase{"vbsiaewn_2K_Albedo", "albedo", "vbsiaewn", kNone, 2048},
                    NameCase{"vbsiaewn_4K_Normal_LOD0", "normal", "vbsiaewn", kNone, 4096},
                    NameCase{"Aset_wood_log_M_rdmsK_8K_Displacement", "displacement",
                             "Aset_wood_log_M_rdmsK", kNone, 8192},
                    NameCase{"vbsiaewn_2K_Cavity", "cavity", "vbsiaewn", kNone, 2048},
                    NameCase{"vbsiaewn_2K_Translucency", "translucency", "vbsiaewn", kNone, 2048}));

INSTANTIATE_TEST_SUITE_P(Unreal, MapNames,
                         testing::Values(NameCase{"T_Rock_BC", "bc", "T_Rock"},
                                         NameCase{"T_Rock_N", "n", "T_Rock"},
                                         NameCase{"T_Rock_ORM", "orm", "T_Rock"},
                                         NameCase{"T_Rock_D", "d", "T_Rock"},
                                         NameCase{"T_Rock_Wall_RMA", "rma", "T_Rock_Wall"},
                                         NameCase{"T_Rock_MRAO", "mrao", "T_Rock"}));

INSTANTIATE_TEST_SUITE_P(
    Unity, MapNames,
    testing::Values(NameCase{"Crate_MetallicSmoothness", "metallicsmoothness", "Crate"},
                    NameCase{"Crate_AlbedoTransparency", "albedotransparency", "Crate"},
                    NameCase{"Crate_MaskMap", "maskmap", "Crate"},
                    NameCase{"Crate_BaseMap", "basemap", "Crate"},
                    NameCase{"crate normal map 2048x1024", "normal", "crate", kNone, 2048},
                    NameCase{"crate-normalmap", "normal", "crate"}));

INSTANTIATE_TEST_SUITE_P(Poliigon, MapNames,
                         testing::Values(NameCase{"MetalBronze001_COL_4K_METALNESS", "col",
                                                  "MetalBronze001", kNone, 4096},
                                         NameCase{"MetalBronze001_NRM16_4K_METALNESS", "nrm",
                                                  "MetalBronze001", kNone, 4096},
                                         NameCase{"MetalBronze001_METALNESS_4K_METALNESS",
                                                  "metalness", "MetalBronze001", kNone, 4096},
                                         NameCase{"Wood_COL_VAR2_1K", "col", "Wood", kNone, 1024},
                                         NameCase{"Wood_DISP16_1K", "disp", "Wood", kNone, 1024}));

INSTANTIATE_TEST_SUITE_P(
    Traps, MapNames,
    testing::Values(NameCase{"color_normal_thing_rough", "rough", "color_normal_thing"},
                    NameCase{"rusty_metal_roughness", "roughness", "rusty_metal"},
                    NameCase{"rustyMetal_metallicRoughness", "metallicroughness", "rustyMetal"},
                    NameCase{"StainedGlassLamp_glass_basecolor-alpha", "basecoloralpha",
                             "StainedGlassLamp_glass"},
                    NameCase{"StainedGlassLamp_glass_occlusion-rough-metal_transmission",
                             "occlusionroughmetaltransmission", "StainedGlassLamp_glass"},
                    NameCase{"clearcoat_normal", "clearcoatnormal", ""},
                    NameCase{"albedo", "albedo", ""}, NameCase{"ALBEDO", "albedo", ""},
                    NameCase{"normal_preview", "", ""}, NameCase{"abnormal", "", ""},
                    NameCase{"colorful", "", ""}, NameCase{"", "", ""}, NameCase{"___", "", ""},
                    NameCase{"2k", "", ""}, NameCase{"99999999999999999999k", "", ""},
                    NameCase{"wall_diff_99999999999999999999", "", ""},
                    NameCase{"Wand_Stra\xc3\x9f"
                             "e_diff",
                             "diff",
                             "Wand_Stra\xc3\x9f"
                             "e"},
                    NameCase{"\xff\xfe_col", "col", "\xff\xfe"}));

TEST(ParseMapName, KeepsTilesLevelsAndVariantsApart) {
  EXPECT_EQ(ParseMapName("wall_BaseColor_1003").tile, "1003");
  EXPECT_EQ(ParseMapName("wall_1004_BaseColor").tile, "1004");
  EXPECT_EQ(ParseMapName("wall_BaseColor_1024").tile, "");  // a resolution
  EXPECT_EQ(ParseMapName("a_2K_Normal_LOD3").level_of_detail, 3);
  EXPECT_EQ(ParseMapName("Wood_COL_VAR2_1K").variant, 2);
  EXPECT_TRUE(ParseMapName("wall_diff_3").bare_number);
  EXPECT_EQ(ParseMapName("wall_diff_3").variant, 3);
  EXPECT_FALSE(ParseMapName("wall_03_diff").bare_number);
}

TEST(ParseMapName, ReadsColourSpaceWords) {
  EXPECT_EQ(ParseMapName("wall_albedo_linear").color_space, "linear");
  EXPECT_EQ(ParseMapName("wall_albedo_sRGB").color_space, "srgb");
  EXPECT_EQ(ParseMapName("wall_albedo").color_space, "auto");
}

TEST(MapTokens, NameOnlyKnownRolesAndChannels) {
  for (const char* name :
       {"albedo", "orm", "rma", "mra", "maskmap", "metallicsmoothness", "specularsmoothness",
        "sheen", "anisotropy", "specular", "transmissionclearcoat", "ord", "clearcoatroughness"}) {
    const MapToken* token = FindMapToken(name);
    ASSERT_NE(token, nullptr) << name;
    for (const auto* parts : {&token->parts, &token->wide_parts}) {
      for (const TokenPart& part : *parts) {
        EXPECT_NE(FindMapRole(part.role), nullptr) << part.role;
        EXPECT_EQ(std::string(part.channels).find_first_not_of("rgba"), std::string::npos);
      }
    }
  }
  EXPECT_EQ(FindMapToken("metalroughness"), nullptr);
  EXPECT_EQ(FindMapToken(""), nullptr);
}

}  // namespace
}  // namespace patina
