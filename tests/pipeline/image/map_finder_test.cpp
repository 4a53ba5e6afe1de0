#include "pipeline/image/map_finder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <map>
#include <string>
#include <vector>

#include "pipeline/image/map_groups.h"
#include "tests/pipeline/image/image_files.h"

namespace patina {
namespace {

using test::Flat;
using test::Noise;
using test::Stored;
using test::TempFolder;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::UnorderedElementsAre;

// "role=file" or "role=file.channels", with "-" in front of an inverted and "?" of an optional map.
std::vector<std::string> Summary(const MapSet& set) {
  std::vector<std::string> lines;
  for (const MapSource& map : set.maps) {
    lines.push_back(std::string(map.invert ? "-" : "") + (map.optional ? "?" : "") + map.role +
                    "=" + map.file + (map.channels.empty() ? "" : ":" + map.channels));
  }
  return lines;
}

std::string NoteOf(const MapSet& set, const std::string& file) {
  std::string text;
  for (const MapNote& note : set.notes) {
    if (note.file == file) text += std::string(MapNoteKindName(note.kind)) + " " + note.text + "; ";
  }
  return text;
}

// A folder with small files: three channels unless the name says otherwise.
class MapFinder : public testing::Test {
 protected:
  void Add(const std::string& file, int channels = 3, int side = 4,
           Stored stored = Stored::kUint8) {
    const std::string extension = std::filesystem::path(file).extension();
    if (extension == ".exr" && stored == Stored::kUint8) stored = Stored::kHalf;
    test::WriteWithLibrary(folder_ / file, Noise(side, side, channels, stored));
  }
  // The only set of the folder.
  MapSet Find() {
    auto sets = FindMaps(folder_.path());
    EXPECT_TRUE(sets) << sets.error().message;
    if (!sets) return {};
    EXPECT_EQ(sets->size(), 1u);
    return sets->front();
  }
  Error FindError() {
    auto sets = FindMaps(folder_.path());
    EXPECT_FALSE(sets);
    return sets ? Error{} : sets.error();
  }
  TempFolder folder_;
};

TEST_F(MapFinder, SplitsPackedMaps) {
  Add("rock_diff_1k.png");
  Add("rock_nor_gl_1k.png");
  Add("rock_arm_1k.png");
  const MapSet set = Find();
  EXPECT_THAT(Summary(set), ElementsAre("albedo=rock_diff_1k.png:rgb", "normal=rock_nor_gl_1k.png",
                                        "ao=rock_arm_1k.png:r", "roughness=rock_arm_1k.png:g",
                                        "metalness=rock_arm_1k.png:b"));
  EXPECT_EQ(set.maps[1].convention, NormalConvention::kOpenGl);
  EXPECT_EQ(set.name, std::filesystem::path(folder_.path()).filename().string());
}

TEST_F(MapFinder, KnowsOtherPackings) {
  Add("a_BaseColor.png");
  Add("a_RMA.png");
  EXPECT_THAT(Summary(Find()), ElementsAre("albedo=a_BaseColor.png:rgb", "ao=a_RMA.png:b",
                                           "roughness=a_RMA.png:r", "metalness=a_RMA.png:g"));
}

TEST_F(MapFinder, ReadsUnityMetallicSmoothness) {
  Add("a_AlbedoTransparency.png", 4);
  Add("a_MetallicSmoothness.png", 4);
  EXPECT_THAT(
      Summary(Find()),
      ElementsAre("albedo=a_AlbedoTransparency.png:rgb", "-roughness=a_MetallicSmoothness.png:a",
                  "metalness=a_MetallicSmoothness.png:r", "?opacity=a_AlbedoTransparency.png:a"));
}

TEST_F(MapFinder, ReportsSmoothnessThatIsNotThere) {
  Add("a_Albedo.png");
  Add("a_MetallicSmoothness.png", 3);
  const MapSet set = Find();
  EXPECT_THAT(Summary(set),
              ElementsAre("albedo=a_Albedo.png:rgb", "metalness=a_MetallicSmoothness.png:r"));
  EXPECT_THAT(NoteOf(set, "a_MetallicSmoothness.png"),
              HasSubstr("ignored no channel for roughness"));
}

TEST_F(MapFinder, InvertsGloss) {
  Add("a_albedo.png");
  Add("a_gloss.png", 1);
  EXPECT_THAT(Summary(Find()), ElementsAre("albedo=a_albedo.png:rgb", "-roughness=a_gloss.png"));
}

TEST_F(MapFinder, PrefersRoughnessToGlossAndOwnFilesToPackedOnes) {
  Add("a_albedo.png");
  Add("a_gloss.png", 1);
  Add("a_roughness.png", 1);
  Add("a_ao.png", 1);
  Add("a_orm.png");
  const MapSet set = Find();
  EXPECT_THAT(Summary(set), ElementsAre("albedo=a_albedo.png:rgb", "ao=a_ao.png",
                                        "roughness=a_roughness.png", "metalness=a_orm.png:b"));
  EXPECT_THAT(NoteOf(set, "a_gloss.png"),
              HasSubstr("ignored roughness is taken from a_roughness.png"));
  EXPECT_THAT(NoteOf(set, "a_orm.png"), HasSubstr("ignored ao is taken from a_ao.png"));
}

TEST_F(MapFinder, PrefersOpenGlNormals) {
  Add("a_Color.png");
  Add("a_NormalDX.png");
  Add("a_NormalGL.png");
  const MapSet set = Find();
  EXPECT_THAT(Summary(set), ElementsAre("albedo=a_Color.png:rgb", "normal=a_NormalGL.png"));
  EXPECT_THAT(NoteOf(set, "a_NormalDX.png"), HasSubstr("ignored"));
}

TEST_F(MapFinder, PrefersTheLargestThenTheMostPrecise) {
  Add("a_diff_1k.png", 3, 4);
  Add("a_diff_2k.jpg", 3, 8);
  Add("a_nor_gl.png", 3, 8);
  Add("a_nor_gl.exr", 3, 8);
  Add("a_rough.jpg", 1, 8);
  Add("a_rough.png", 1, 8);
  const MapSet set = Find();
  EXPECT_THAT(Summary(set), ElementsAre("albedo=a_diff_2k.jpg:rgb", "normal=a_nor_gl.exr",
                                        "roughness=a_rough.png"));
  EXPECT_THAT(NoteOf(set, "a_diff_1k.png"), HasSubstr("ignored the same map as a_diff_2k.jpg"));
}

TEST_F(MapFinder, RefusesTwoMapsForOneRole) {
  Add("a_albedo.png");
  Add("a_diffuse.png");
  const Error error = FindError();
  EXPECT_EQ(error.code, ErrorCode::kConflict);
  EXPECT_THAT(error.message, HasSubstr("a_albedo.png"));
  EXPECT_THAT(error.message, HasSubstr("a_diffuse.png"));
  EXPECT_THAT(error.message, HasSubstr("--maps"));
}

TEST_F(MapFinder, RefusesTheSameMapWrittenTwoWays) {
  Add("a-b_albedo.png");
  Add("a_b_albedo.png");
  EXPECT_EQ(FindError().code, ErrorCode::kConflict);
}

TEST_F(MapFinder, IgnoresAnotherBaseColourOfAFullSet) {
  Add("shutter_02_diff_2k.png");
  Add("shutter_02_graffiti_diff_2k.png");
  Add("shutter_02_nor_gl_2k.png");
  const MapSet set = Find();
  EXPECT_THAT(Summary(set),
              ElementsAre("albedo=shutter_02_diff_2k.png:rgb", "normal=shutter_02_nor_gl_2k.png"));
  EXPECT_THAT(NoteOf(set, "shutter_02_graffiti_diff_2k.png"),
              HasSubstr("ignored another base colour for shutter_02"));
}

TEST_F(MapFinder, FindsSeveralMaterials) {
  Add("ToyCar_basecolor.png", 4);
  Add("ToyCar_normal.png");
  Add("Fabric_baseColor.png");
  Add("Fabric_occlusion.png");
  auto sets = FindMaps(folder_.path());
  ASSERT_TRUE(sets) << sets.error().message;
  ASSERT_EQ(sets->size(), 2u);
  EXPECT_THAT(Summary((*sets)[0]),
              ElementsAre("albedo=Fabric_baseColor.png:rgb", "ao=Fabric_occlusion.png"));
  EXPECT_THAT(Summary((*sets)[1]),
              ElementsAre("albedo=ToyCar_basecolor.png:rgb", "normal=ToyCar_normal.png",
                          "?opacity=ToyCar_basecolor.png:a"));
  EXPECT_THAT((*sets)[0].name, testing::EndsWith("_Fabric"));
  EXPECT_THAT((*sets)[1].name, testing::EndsWith("_ToyCar"));
}

TEST_F(MapFinder, NamesSetsWithoutOpeningAFile) {
  for (const char* file : {"ToyCar_basecolor.png", "ToyCar_normal.png", "Fabric_basecolor.png"})
    std::ofstream(folder_.path() + "/" + file) << "no image";
  auto names = FindSetNames(folder_.path());
  ASSERT_TRUE(names) << names.error().message;
  EXPECT_THAT(*names, ElementsAre(testing::EndsWith("_Fabric"), testing::EndsWith("_ToyCar")));
  EXPECT_FALSE(FindMaps(folder_.path()));
  std::filesystem::remove(folder_.path() + "/Fabric_basecolor.png");
  names = FindSetNames(folder_.path());
  ASSERT_TRUE(names) << names.error().message;
  EXPECT_EQ(names->size(), 1u);
}

TEST_F(MapFinder, LendsSharedMapsToEveryMaterialTheyFit) {
  Add("king_white_base_color.png");
  Add("king_black_base_color.png");
  Add("king_shared_metallic.png", 1);
  Add("queen_white_base_color.png");
  auto sets = FindMaps(folder_.path());
  ASSERT_TRUE(sets) << sets.error().message;
  ASSERT_EQ(sets->size(), 3u);
  EXPECT_THAT(Summary((*sets)[0]), ElementsAre("albedo=king_black_base_color.png:rgb",
                                               "metalness=king_shared_metallic.png"));
  EXPECT_THAT(Summary((*sets)[1]), ElementsAre("albedo=king_white_base_color.png:rgb",
                                               "metalness=king_shared_metallic.png"));
  EXPECT_THAT(Summary((*sets)[2]), ElementsAre("albedo=queen_white_base_color.png:rgb"));
}

TEST_F(MapFinder, TakesEverythingForTheOnlyBaseColour) {
  Add("wicker_basecolor.png");
  Add("clearcoat_normal.png");
  Add("something_rough.png", 1);
  EXPECT_THAT(Summary(Find()),
              ElementsAre("albedo=wicker_basecolor.png:rgb", "roughness=something_rough.png",
                          "clearcoat_normal=clearcoat_normal.png"));
}

TEST_F(MapFinder, KeepsTilesApart) {
  Add("wall_BaseColor.1001.png");
  Add("wall_BaseColor.1002.png");
  Add("wall_Normal.1001.png");
  auto sets = FindMaps(folder_.path());
  ASSERT_TRUE(sets) << sets.error().message;
  ASSERT_EQ(sets->size(), 2u);
  EXPECT_THAT(Summary((*sets)[0]),
              ElementsAre("albedo=wall_BaseColor.1001.png:rgb", "normal=wall_Normal.1001.png"));
  EXPECT_THAT(Summary((*sets)[1]), ElementsAre("albedo=wall_BaseColor.1002.png:rgb"));
  EXPECT_NE((*sets)[0].name, (*sets)[1].name);
}

TEST_F(MapFinder, PrefersTheFirstLevelOfDetail) {
  Add("x_2K_Albedo.png");
  Add("x_2K_Normal_LOD3.png", 3, 16);
  Add("x_2K_Normal_LOD0.png");
  EXPECT_THAT(Summary(Find()),
              ElementsAre("albedo=x_2K_Albedo.png:rgb", "normal=x_2K_Normal_LOD0.png"));
}

TEST_F(MapFinder, TakesTheFileWithTheMaterialsOwnNameForItsColour) {
  Add("rusty_metal.png");
  Add("rusty_metal_normal.png");
  Add("rusty_metal_ao.png", 1);
  const MapSet set = Find();
  EXPECT_THAT(Summary(set), ElementsAre("albedo=rusty_metal.png:rgb",
                                        "normal=rusty_metal_normal.png", "ao=rusty_metal_ao.png"));
  EXPECT_THAT(NoteOf(set, "rusty_metal.png"), HasSubstr("guessed albedo"));
}

TEST_F(MapFinder, IgnoresAPreviewBesideTheBaseColour) {
  Add("Bricks102.png");
  Add("Bricks102_1K_Color.png");
  Add("Bricks102_1K_Roughness.png", 1);
  const MapSet set = Find();
  EXPECT_THAT(Summary(set), ElementsAre("albedo=Bricks102_1K_Color.png:rgb",
                                        "roughness=Bricks102_1K_Roughness.png"));
  EXPECT_THAT(NoteOf(set, "Bricks102.png"), HasSubstr("ignored"));
}

TEST_F(MapFinder, BelievesSingleLettersOnlyInCompany) {
  Add("T_Rock_D.png");
  Add("T_Rock_N.png");
  const MapSet set = Find();
  EXPECT_THAT(Summary(set), ElementsAre("albedo=T_Rock_D.png:rgb", "normal=T_Rock_N.png"));
  EXPECT_THAT(NoteOf(set, "T_Rock_N.png"), HasSubstr("guessed"));
  std::filesystem::remove(folder_ / "T_Rock_D.png");
  EXPECT_EQ(FindError().code, ErrorCode::kNotFound);
}

TEST_F(MapFinder, DoesNotTakeAMaterialForAMap) {
  Add("rusty_metal.png");
  const Error error = FindError();
  EXPECT_EQ(error.code, ErrorCode::kNotFound);
  EXPECT_THAT(error.message, HasSubstr("rusty_metal.png"));
  EXPECT_THAT(error.message, HasSubstr("basecolor"));
}

TEST_F(MapFinder, DecidesByTheNumberOfChannels) {
  Add("a_albedo.png");
  Add("a_specular.png");
  Add("a_sheen.png", 4);
  Add("a_metallicRoughness.png");
  Add("a_scattering.png", 1);
  EXPECT_THAT(Summary(Find()),
              ElementsAre("albedo=a_albedo.png:rgb", "roughness=a_metallicRoughness.png:g",
                          "metalness=a_metallicRoughness.png:b",
                          "specular_color=a_specular.png:rgb", "sheen_color=a_sheen.png:rgb",
                          "?sheen_roughness=a_sheen.png:a", "subsurface=a_scattering.png"));
}

TEST_F(MapFinder, ReadsGreyColours) {
  Add("a_color.png", 1);
  Add("b_color.png", 2);
  auto sets = FindMaps(folder_.path());
  ASSERT_TRUE(sets) << sets.error().message;
  EXPECT_THAT(Summary((*sets)[0]), ElementsAre("albedo=a_color.png"));
  EXPECT_THAT(Summary((*sets)[1]), ElementsAre("albedo=b_color.png", "?opacity=b_color.png:a"));
}

TEST_F(MapFinder, SaysWhatIsInAFolderWithoutMaps) {
  Add("photo.png");
  test::WriteBytes(folder_ / "notes.txt", {'x'});
  const Error error = FindError();
  EXPECT_EQ(error.code, ErrorCode::kNotFound);
  EXPECT_THAT(error.message, HasSubstr("notes.txt, photo.png"));
  EXPECT_THAT(error.message, HasSubstr("--maps"));
}

TEST(FindMaps, ReportsBadFolders) {
  TempFolder folder;
  EXPECT_EQ(FindMaps(folder / "missing").error().code, ErrorCode::kNotFound);
  EXPECT_EQ(FindMaps(folder.path()).error().code, ErrorCode::kNotFound);
  EXPECT_THAT(FindMaps(folder.path()).error().message, HasSubstr("Files: none"));
  test::WriteBytes(folder / "file", {1});
  EXPECT_EQ(FindMaps(folder / "file").error().code, ErrorCode::kInvalidArgument);
}

TEST_F(MapFinder, PassesOnWhatIsWrongWithANeededFile) {
  Add("a_albedo.png");
  test::WriteBytes(folder_ / "a_normal.png", {1, 2, 3});
  const Error error = FindError();
  EXPECT_EQ(error.code, ErrorCode::kUnsupported);
  EXPECT_THAT(error.message, HasSubstr("a_normal.png"));
}

TEST_F(MapFinder, DoesNotSearchSubfoldersOrHiddenFiles) {
  Add("a_albedo.png");
  std::filesystem::create_directory(folder_ / "sub_normal.png");
  Add(".a_normal.png");
  EXPECT_THAT(Summary(Find()), ElementsAre("albedo=a_albedo.png:rgb"));
}

TEST_F(MapFinder, TakesAFolderWithATrailingSlashOrDots) {
  Add("a_albedo.png");
  const std::string name = std::filesystem::path(folder_.path()).filename().string();
  for (const char* suffix : {"/", "//", "/.", "/./"}) {
    auto sets = FindMaps(folder_.path() + suffix);
    ASSERT_TRUE(sets) << sets.error().message;
    EXPECT_EQ(sets->front().name, name) << suffix;
  }
}

class MapList : public MapFinder {
 protected:
  Error ResolveError(const std::vector<MapRequest>& requests) {
    auto set = ResolveMaps(requests, folder_.path(), "x");
    EXPECT_FALSE(set);
    return set ? Error{} : set.error();
  }
};

TEST_F(MapList, IsTakenAtItsWord) {
  Add("one.png", 4);
  Add("two.png");
  MapRequest albedo{"albedo", "one.png", "bgr", "linear", NormalConvention::kAuto,
                    false};
  MapRequest normal{"normal",          folder_ / "two.png",        "",
                    "auto", NormalConvention::kDirectX, false};
  MapRequest rough{"roughness", "one.png", "a", "auto", NormalConvention::kAuto, true};
  auto set = ResolveMaps({rough, normal, albedo}, folder_.path(), "thing");
  ASSERT_TRUE(set) << set.error().message;
  EXPECT_EQ(set->name, "thing");
  ASSERT_EQ(set->maps.size(), 3u);
  EXPECT_EQ(set->maps[0].channels, "bgr");
  EXPECT_EQ(set->maps[0].color_space, "linear");
  EXPECT_EQ(set->maps[1].convention, NormalConvention::kDirectX);
  EXPECT_FALSE(set->maps[1].convention_from_name);
  EXPECT_EQ(set->maps[2].role, "roughness");
  EXPECT_TRUE(set->maps[2].invert);
}

TEST_F(MapList, UnpacksPackedRoles) {
  Add("one.png");
  auto set =
      ResolveMaps({{"orm", "one.png", "", "auto", NormalConvention::kAuto, false}},
                  folder_.path(), "x");
  ASSERT_TRUE(set) << set.error().message;
  EXPECT_THAT(Summary(*set),
              ElementsAre("ao=one.png:r", "roughness=one.png:g", "metalness=one.png:b"));
}

TEST_F(MapList, IsRefusedWithTheEntryNamed) {
  Add("one.png");
  const auto request = [](const std::string& role, const std::string& file,
                          const std::string& channels = "") {
    return MapRequest{role, file, channels, "auto", NormalConvention::kAuto, false};
  };
  EXPECT_EQ(ResolveError({}).code, ErrorCode::kInvalidArgument);
  const Error unknown = ResolveError({request("albedo", "one.png"), request("colour", "one.png")});
  EXPECT_EQ(unknown.code, ErrorCode::kInvalidArgument);
  EXPECT_THAT(unknown.message, HasSubstr("maps[1]"));
  EXPECT_THAT(unknown.message, HasSubstr("roughness"));
  EXPECT_EQ(ResolveError({request("albedo", "none.png")}).code, ErrorCode::kNotFound);
  EXPECT_EQ(ResolveError({request("albedo", "")}).code, ErrorCode::kInvalidArgument);
  EXPECT_EQ(ResolveError({request("albedo", "one.png", "rg")}).code, ErrorCode::kInvalidArgument);
  EXPECT_EQ(ResolveError({request("roughness", "one.png", "rgb")}).code,
            ErrorCode::kInvalidArgument);
  EXPECT_EQ(ResolveError({request("roughness", "one.png", "x")}).code, ErrorCode::kInvalidArgument);
  EXPECT_EQ(ResolveError({request("roughness", "one.png", "a")}).code, ErrorCode::kInvalidArgument);
  EXPECT_EQ(ResolveError({request("ao", "one.png", "r"), request("orm", "one.png")}).code,
            ErrorCode::kConflict);
}

// Every folder of real sets that has a base colour, with the roles it must yield.
TEST(RealFolders, AreUnderstoodWithoutAList) {
  const std::string root = test::SharedData("pbr");
  if (root.empty()) GTEST_SKIP() << "the shared texture sets are not here";
  const std::string ph = "albedo normal ao roughness metalness";
  const std::map<std::string, std::vector<std::string>> expected = {
      {"acg1k_Bricks102", {"albedo normal ao roughness displacement"}},
      {"acg1k_Facade005", {"albedo normal roughness metalness displacement"}},
      {"acg1k_Rock020", {"albedo normal ao roughness displacement"}},
      {"acg1k_Tiles036", {"albedo normal roughness displacement"}},
      {"gltf_ClearcoatWicker", {ph + " clearcoat_normal"}},
      {"gltf_SheenCloth", {ph + " opacity sheen_color sheen_roughness"}},
      {"gltf_ToyCar", {"albedo normal ao", ph + " emissive opacity clearcoat"}},
      {"khr2k_StainedGlassLamp_glass", {ph + " emissive opacity clearcoat transmission"}},
      {"khr2k_WaterBottle", {ph + " emissive"}},
      {"mtlx2k_BoomBox", {ph + " emissive"}},
      {"mtlx2k_chess_king_white", {"albedo normal roughness metalness subsurface"}},
      {"ph1k_rosewood_veneer1", {"albedo normal roughness"}},
  };
  int folders = 0;
  for (const auto& entry : std::filesystem::directory_iterator(root)) {
    if (!entry.is_directory()) continue;
    const std::string name = entry.path().filename().string();
    const auto sets = FindMaps(entry.path().string());
    if (name == "gltf_small_glb") {
      EXPECT_EQ(sets.error().code, ErrorCode::kNotFound);
      continue;
    }
    ASSERT_TRUE(sets) << sets.error().message;
    std::vector<std::string> roles;
    for (const MapSet& set : *sets) {
      std::string line;
      for (const MapSource& map : set.maps) line += (line.empty() ? "" : " ") + map.role;
      roles.push_back(line);
    }
    const auto known = expected.find(name);
    EXPECT_EQ(roles, known != expected.end() ? known->second : std::vector<std::string>{ph})
        << name;
    ++folders;
  }
  EXPECT_GE(folders, 20);
}

}  // namespace
}  // namespace patina
