// Lights of files that Blender's glTF exporter wrote, in the units that it used.
#include <gtest/gtest.h>

#include "scene/load.h"
#include "tests/support/gltf_builder.h"

namespace relief {
namespace {

using nlohmann::json;

/// A square under a lamp and a sun.
test::GltfBuilder lit_square(const std::string& generator, double lamp, double sun)
{
  test::GltfBuilder b = test::square_scene();
  b.json["asset"]["generator"] = generator;
  b.json["extensions"]["KHR_lights_punctual"]["lights"] = {{{"type", "point"}, {"intensity", lamp}},
                                                           {{"type", "directional"}, {"intensity", sun}}};
  for (const int light : {0, 1}) b.root_node({{"extensions", {{"KHR_lights_punctual", {{"light", light}}}}}});
  return b;
}

struct Loaded {
  double lamp = 0, sun = 0;  ///< W/sr, W/m²
  std::string warnings;      ///< about light
};

Loaded load(const test::GltfBuilder& b, float luminous_efficacy = 0)
{
  const test::TemporaryFolder folder;
  LoadOptions options;
  options.luminous_efficacy = luminous_efficacy;
  const Scene scene = scene_load(folder.write("s.gltf", b.gltf()), options);
  Loaded loaded{
      static_cast<double>(scene.lights.at(0).emission.x), static_cast<double>(scene.lights.at(1).emission.x), {}};
  for (const std::string& text : scene.warnings) {
    if (text.find("light") != std::string::npos) loaded.warnings += text + "\n";
  }
  return loaded;
}

// What Blender 3.4.1 wrote for a lamp of 100 W and a sun of 3 W/m².
constexpr double kLampWatts = 100, kLamp = 7.957747154594767, kSun = 3;

TEST(BlenderLightUnits, StandardIsDividedBy683)
{
  for (const char* version : {"3.4.50", "3.4.40", "3.6.28", "4.3.47", "5.3.18"}) {
    const Loaded l = load(lit_square(std::string("Khronos glTF Blender I/O v") + version, 5435.141306588225, 2049));
    EXPECT_NEAR(l.lamp, kLamp, 1e-5) << version;
    EXPECT_NEAR(l.sun, kSun, 1e-5) << version;
    EXPECT_NE(l.warnings.find("683 lm/W; --luminous-efficacy"), std::string::npos) << l.warnings;
  }
}

TEST(BlenderLightUnits, UnitlessStaysAsItIs)
{
  const Loaded l = load(lit_square("Khronos glTF Blender I/O v3.4.50", kLamp, kSun));
  EXPECT_NEAR(l.lamp, kLamp, 1e-5);
  EXPECT_NEAR(l.sun, kSun, 1e-5);
  EXPECT_NE(l.warnings.find("Unitless"), std::string::npos) << l.warnings;
}

TEST(BlenderLightUnits, BeforeThereWereUnitsLampsAreInWatts)
{
  for (const char* version : {"3.3.27", "3.4.39", "1.1.36"}) {
    const Loaded l = load(lit_square(std::string("Khronos glTF Blender I/O v") + version, kLampWatts, kSun));
    EXPECT_NEAR(l.lamp, kLamp, 1e-5) << version;
    EXPECT_NEAR(l.sun, kSun, 1e-5) << version;
    EXPECT_NE(l.warnings.find("before 3.4: watts"), std::string::npos) << l.warnings;
  }
}

TEST(BlenderLightUnits, SceneAndOptionSayOtherwise)
{
  test::GltfBuilder b = lit_square("Khronos glTF Blender I/O v3.4.50", 2000, 1000);
  EXPECT_NEAR(load(b, 10).lamp, 200, 1e-4);
  b.json["extensions"]["RELIEF_render"]["luminousEfficacy"] = 1;
  const Loaded l = load(b);
  EXPECT_EQ(l.lamp, 2000);
  EXPECT_EQ(l.sun, 1000);
  EXPECT_EQ(l.warnings, "");
  EXPECT_EQ(load(b, 100).sun, 10);
}

TEST(BlenderLightUnits, OtherProgramsMeanWhatTheySay)
{
  for (const json& generator : {json("THREE.GLTFExporter r150"), json("Khronos glTF Blender I/O vX"), json()}) {
    test::GltfBuilder b = lit_square("", 2000, 1000);
    if (generator.is_null())
      b.json["asset"].erase("generator");
    else
      b.json["asset"]["generator"] = generator;
    const Loaded l = load(b);
    EXPECT_EQ(l.lamp, 2000);
    EXPECT_EQ(l.sun, 1000);
    EXPECT_EQ(l.warnings, "");
  }
}

}  // namespace
}  // namespace relief
