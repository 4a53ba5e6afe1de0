// Small image sets on disk.
#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "formats/brdf/brdf_source.h"
#include "pipeline/image/image_io.h"
#include "tests/formats/test_support.h"

namespace patina::svbrdf::testing_support {

// f of texel (x, y) of image i.
using Look = std::function<void(int i, int x, int y, float rgb[3])>;

inline brdf::Direction Towards(double theta_deg, double phi_deg) {
  const double theta = theta_deg * M_PI / 180, phi = phi_deg * M_PI / 180;
  return {static_cast<float>(std::sin(theta) * std::cos(phi)),
          static_cast<float>(std::sin(theta) * std::sin(phi)), static_cast<float>(std::cos(theta))};
}

// The list of `images` images of one size, image i lit and seen from directions of its own.
inline nlohmann::json ListOf(int images, int width, int height) {
  nlohmann::json json = {{"version", 1}, {"width", width}, {"height", height}};
  for (int i = 0; i < images; ++i) {
    const brdf::Direction light = Towards(7 + 61.0 * i / images, 40.0 * i),
                          view = Towards(3 + 50.0 * ((5 * i) % images) / images, -73.0 * i);
    json["images"].push_back({{"file", "i" + std::to_string(i) + ".exr"},
                              {"light", {light.x, light.y, light.z}},
                              {"view", {view.x, view.y, view.z}}});
  }
  return json;
}

inline std::string WriteList(const std::string& folder, const nlohmann::json& json) {
  const std::string path = folder + "/set.btf.json";
  std::ofstream(path) << json.dump(1);
  return path;
}

// Writes list and images; returns the path of the list.
inline std::string WriteSet(const std::string& folder, int images, int width, int height,
                            const Look& look, const std::string& address = "clamp") {
  nlohmann::json json = ListOf(images, width, height);
  json["address"] = address;
  for (int i = 0; i < images; ++i) {
    std::vector<float> rgb(3 * static_cast<size_t>(width) * height);
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x)
        look(i, x, y, rgb.data() + 3 * (static_cast<size_t>(y) * width + x));
    }
    const Status written = WriteImage(folder + "/" + json["images"][i]["file"].get<std::string>(),
                                      WriteFormat::kExrFloat, width, height, 3, rgb.data());
    EXPECT_TRUE(written) << written.error().message;
  }
  return WriteList(folder, json);
}

}  // namespace patina::svbrdf::testing_support
