// Materials, lights, cameras, environment and settings: what the file says is what the scene holds.
#include <gtest/gtest.h>

#include <cmath>

#include "kernel/feature_mask.h"
#include "scene/khronos_extensions.h"
#include "scene/texture_store.h"
#include "tests/support/loaded_scene.h"

namespace relief {
namespace {

using nlohmann::json;
using test::GltfBuilder;
using test::has_warning;

void expect_near(Vec3f a, Vec3f b, float tolerance = 1e-6f)
{
  EXPECT_NEAR(a.x, b.x, tolerance);
  EXPECT_NEAR(a.y, b.y, tolerance);
  EXPECT_NEAR(a.z, b.z, tolerance);
}

/// The square with one material and one texture.
GltfBuilder square_with(const json& material)
{
  GltfBuilder b = test::square_scene();
  b.json["images"] = {{{"uri", test::kPixelPng}}};
  b.json["textures"] = {{{"source", 0}}};
  b.json["materials"] = {material};
  b.json["meshes"][0]["primitives"][0]["material"] = 0;
  return b;
}

Material load_material(const json& material)
{
  const Scene scene = load(square_with(material));
  return scene.materials.at(static_cast<std::size_t>(scene.instances.at(0).material_index));
}

// --- textures ---

Vec2f apply(const TextureRef& ref, Vec2f uv)
{
  return {ref.m00 * uv.x + ref.m01 * uv.y + ref.m02, ref.m10 * uv.x + ref.m11 * uv.y + ref.m12};
}

TEST(TextureTransform, OffsetAndScaleByHand)
{
  TextureRef ref;
  khronos_texture_transform(ref, 0.5, -1, 0, 2, 3);
  const Vec2f uv = apply(ref, {0.25f, 0.5f});
  EXPECT_FLOAT_EQ(uv.x, 1.0f);
  EXPECT_FLOAT_EQ(uv.y, 0.5f);
}

// The extension's example: offset (0, 1), a quarter turn, scale ½ takes the lower left quadrant of the image.
TEST(TextureTransform, AQuarterTurnTakesTheQuadrantOfTheSpecificationsExample)
{
  TextureRef ref;
  khronos_texture_transform(ref, 0, 1, 1.5707963267948966, 0.5, 0.5);
  for (const Vec2f uv : {Vec2f{0, 0}, Vec2f{1, 0}, Vec2f{0, 1}, Vec2f{1, 1}}) {
    const Vec2f t = apply(ref, uv);
    EXPECT_GE(t.x, -1e-6f);
    EXPECT_LE(t.x, 0.5f + 1e-6f);
    EXPECT_GE(t.y, 0.5f - 1e-6f);
    EXPECT_LE(t.y, 1.0f + 1e-6f);
  }
}

// The quad of Khronos' test model that is turned by 22.5°: where its marker sits (67.5° from the u axis, 1.1 away)
// the texture must be read at 45°.
TEST(TextureTransform, TurnsTheWayTheTestModelPaints)
{
  TextureRef ref;
  khronos_texture_transform(ref, 0, 0, 0.39269908169872414, 1, 1);
  const Vec2f t = apply(ref, {0.4209518f, 1.0162675f});
  EXPECT_NEAR(std::atan2(t.y, t.x), 0.25f * kPi, 1e-6f);
}

TEST(TextureTransform, IsReadWithItsTexCoord)
{
  const Material m = load_material(
      {{"pbrMetallicRoughness",
        {{"baseColorTexture",
          {{"index", 0},
           {"texCoord", 0},
           {"extensions",
            {{"KHR_texture_transform", {{"scale", {4, 5}}, {"offset", {0.1, 0.2}}, {"texCoord", 1}}}}}}}}}});
  EXPECT_EQ(m.base_color_texture.uv_set, 1);
  EXPECT_FLOAT_EQ(m.base_color_texture.m00, 4);
  EXPECT_FLOAT_EQ(m.base_color_texture.m11, 5);
  EXPECT_FLOAT_EQ(m.base_color_texture.m02, 0.1f);
  EXPECT_FLOAT_EQ(m.base_color_texture.m12, 0.2f);
}

TEST(Textures, EqualUsesShareOneTextureAndColourSpacesDoNot)
{
  const json use = {{"index", 0}};
  const Scene scene =
      load(square_with({{"pbrMetallicRoughness", {{"baseColorTexture", use}, {"metallicRoughnessTexture", use}}},
                        {"normalTexture", use},
                        {"emissiveTexture", use},
                        {"emissiveFactor", {1, 1, 1}}}));
  const Material& m = scene.materials.at(0);
  EXPECT_EQ(m.base_color_texture.texture_index, m.emission_texture.texture_index);
  EXPECT_EQ(m.metallic_roughness_texture.texture_index, m.normal_texture.texture_index);
  EXPECT_NE(m.base_color_texture.texture_index, m.normal_texture.texture_index);
  EXPECT_EQ(scene.textures->views().size(), 2u);
  EXPECT_EQ(feature_mask_of(m) & (kFeatureTextures | kFeatureNormalMaps), kFeatureTextures | kFeatureNormalMaps);
}

TEST(Textures, SamplersAreKept)
{
  GltfBuilder b = square_with({{"pbrMetallicRoughness", {{"baseColorTexture", {{"index", 0}}}}}});
  b.json["samplers"] = {{{"wrapS", 33071}, {"wrapT", 33648}, {"magFilter", 9728}}};
  b.json["textures"][0]["sampler"] = 0;
  const Scene scene = load(b);
  const TextureView& view = scene.textures->views()[0];
  EXPECT_EQ(view.wrap_u, Wrap::kClamp);
  EXPECT_EQ(view.wrap_v, Wrap::kMirror);
  EXPECT_EQ(view.filter, TexelFilter::kNearest);
}

TEST(Textures, ImagesMayLieInBufferViewsAndFiles)
{
  GltfBuilder b = square_with({{"pbrMetallicRoughness", {{"baseColorTexture", {{"index", 0}}}}}});
  const std::string uri(test::kPixelPng);
  const ByteArray png = gltf_decode_data_uri(uri, "", "");
  std::vector<std::uint8_t> bytes(png.size);
  std::memcpy(bytes.data(), png.data.get(), png.size);
  b.json["images"][0] = {{"bufferView", b.view(bytes)}, {"mimeType", "image/png"}};
  b.json["extensions"]["RELIEF_environment"] = json::object();
  EXPECT_EQ(load(b).textures->views().size(), 1u);
  const test::TemporaryFolder folder;
  folder.write("pixel one.png", {reinterpret_cast<const char*>(bytes.data()), bytes.size()});
  b.json["images"][0] = {{"uri", "pixel%20one.png"}};
  const Scene scene = scene_load(folder.write("scene.gltf", b.gltf()));
  EXPECT_EQ(scene.textures->views().size(), 1u);
  EXPECT_EQ(scene.files.back().path, (folder / "pixel one.png").string());
}

// --- materials ---

TEST(Materials, DefaultsAreGltfs)
{
  const Material m = load_material(json::object());
  EXPECT_EQ(m.base_color, (Vec3f{1, 1, 1}));
  EXPECT_EQ(m.metallic, 1);
  EXPECT_EQ(m.roughness, 1);
  EXPECT_EQ(m.emission, (Vec3f{0, 0, 0}));
  EXPECT_EQ(m.ior, 1.5f);
  EXPECT_EQ(m.alpha_mode, AlphaMode::kOpaque);
  EXPECT_FALSE(m.double_sided);
}

TEST(Materials, CoreIsRead)
{
  const Material m =
      load_material({{"pbrMetallicRoughness",
                      {{"baseColorFactor", {0.1, 0.2, 0.3, 0.4}}, {"metallicFactor", 0.5}, {"roughnessFactor", 0.25}}},
                     {"alphaMode", "MASK"},
                     {"alphaCutoff", 0.7},
                     {"doubleSided", true},
                     {"emissiveFactor", {1, 0.5, 0}},
                     {"normalTexture", {{"index", 0}, {"scale", 2}}}});
  EXPECT_EQ(m.base_color, (Vec3f{0.1f, 0.2f, 0.3f}));
  EXPECT_EQ(m.base_alpha, 0.4f);
  EXPECT_EQ(m.metallic, 0.5f);
  EXPECT_EQ(m.roughness, 0.25f);
  EXPECT_EQ(m.alpha_mode, AlphaMode::kMask);
  EXPECT_EQ(m.alpha_cutoff, 0.7f);
  EXPECT_TRUE(m.double_sided);
  EXPECT_EQ(m.emission, (Vec3f{1, 0.5f, 0}));
  EXPECT_EQ(m.normal_scale, 2);
}

TEST(Materials, ExtensionsAreRead)
{
  const Material m =
      load_material({{"emissiveFactor", {1, 1, 0.5}},
                     {"extensions",
                      {{"KHR_materials_transmission", {{"transmissionFactor", 0.9}}},
                       {"KHR_materials_ior", {{"ior", 1.33}}},
                       {"KHR_materials_volume",
                        {{"thicknessFactor", 0.1}, {"attenuationDistance", 3}, {"attenuationColor", {0.1, 0.2, 0.3}}}},
                       {"KHR_materials_clearcoat",
                        {{"clearcoatFactor", 0.4},
                         {"clearcoatRoughnessFactor", 0.3},
                         {"clearcoatNormalTexture", {{"index", 0}, {"scale", 0.5}}}}},
                       {"KHR_materials_sheen", {{"sheenColorFactor", {0.5, 0.6, 0.7}}, {"sheenRoughnessFactor", 0.8}}},
                       {"KHR_materials_specular", {{"specularFactor", 0.6}, {"specularColorFactor", {1, 2, 3}}}},
                       {"KHR_materials_emissive_strength", {{"emissiveStrength", 10}}},
                       {"KHR_materials_unlit", json::object()}}}});
  EXPECT_EQ(m.transmission, 0.9f);
  EXPECT_EQ(m.ior, 1.33f);
  EXPECT_EQ(m.thickness, 0.1f);
  EXPECT_EQ(m.clearcoat, 0.4f);
  EXPECT_EQ(m.clearcoat_roughness, 0.3f);
  EXPECT_EQ(m.clearcoat_normal_scale, 0.5f);
  EXPECT_EQ(m.sheen_color, (Vec3f{0.5f, 0.6f, 0.7f}));
  EXPECT_EQ(m.sheen_roughness, 0.8f);
  EXPECT_EQ(m.specular, 0.6f);
  EXPECT_EQ(m.specular_color, (Vec3f{1, 2, 3}));
  EXPECT_EQ(m.emission, (Vec3f{10, 10, 5}));
  EXPECT_TRUE(m.unlit);
}

/// What KHR_materials_volume absorbs is a medium of the scene, where light gets in: through solid glass, whatever makes it such.
TEST(Materials, VolumesAbsorbInSolidGlass)
{
  const json volume{{"thicknessFactor", 0.1}, {"attenuationDistance", 3}, {"attenuationColor", {0.1, 0.2, 1}}};
  const json thin{{"attenuationDistance", 3}, {"attenuationColor", {0.1, 0.2, 1}}};
  const json glass{{"transmissionFactor", 0.9}};
  const json closure{{"closures", {{{"type", "glass"}, {"color", {1, 1, 1}}}}}};
  const auto sigma_of = [](const json& extensions) {
    const Scene scene = load(square_with({{"extensions", extensions}}));
    const Material& m = scene.materials.at(static_cast<std::size_t>(scene.instances.at(0).material_index));
    EXPECT_FALSE(m.is_boundary);
    return m.medium_index < 0 ? Vec3f{} : scene.media.at(static_cast<std::size_t>(m.medium_index)).sigma_t;
  };
  const auto expect_absorbs = [&](const json& extensions, float more) {
    const Vec3f sigma = sigma_of(extensions);
    EXPECT_NEAR(std::exp(-3 * (sigma.x - more)), 0.1f, 1e-6f);
    EXPECT_NEAR(std::exp(-3 * (sigma.y - more)), 0.2f, 1e-6f);
    EXPECT_NEAR(sigma.z, more, 1e-6f);
  };
  expect_absorbs({{"KHR_materials_volume", volume}, {"KHR_materials_transmission", glass}}, 0);
  expect_absorbs({{"KHR_materials_volume", thin}, {"RELIEF_surface", closure}}, 0);
  EXPECT_TRUE(is_zero(sigma_of({{"KHR_materials_volume", thin}, {"KHR_materials_transmission", glass}})));
  EXPECT_TRUE(is_zero(sigma_of({{"KHR_materials_volume", volume}})));
  // Besides what else is in there.
  const json fog{{"closures", {{{"type", "absorption"}, {"color", {0.5, 0.5, 0.5}}, {"density", 2}}}}};
  expect_absorbs({{"KHR_materials_volume", volume}, {"KHR_materials_transmission", glass}, {"RELIEF_volume", fog}}, 1);
}

TEST(Materials, UnknownPropertiesOfKnownExtensionsAreWarnedAbout)
{
  const Scene scene = load(square_with({{"extensions", {{"KHR_materials_ior", {{"ior", 1.4}, {"iorr", 2}}}}}}));
  EXPECT_TRUE(has_warning(scene, "/materials/0/extensions/KHR_materials_ior/iorr"));
}

TEST(Materials, TexturesWithoutCoordinatesAreWarnedAbout)
{
  GltfBuilder b = square_with({{"normalTexture", {{"index", 0}, {"texCoord", 1}}}});
  const Scene scene = load(b);
  EXPECT_TRUE(has_warning(scene, "TEXCOORD_1"));
}

TEST(Extensions, UsedButUnknownOnesAreOneWarning)
{
  GltfBuilder b = test::square_scene();
  b.json["extensionsUsed"] = {"FB_geometry_metadata", "KHR_materials_ior"};
  const Scene scene = load(b);
  EXPECT_TRUE(has_warning(scene, "FB_geometry_metadata"));
  EXPECT_FALSE(has_warning(scene, "KHR_materials_ior"));
}

// --- lights ---

GltfBuilder lit_by(const json& light, const json& node = json::object())
{
  GltfBuilder b = test::square_scene();
  b.json["extensions"]["KHR_lights_punctual"]["lights"] = {light};
  json lamp = node;
  lamp["extensions"]["KHR_lights_punctual"]["light"] = 0;
  b.root_node(lamp);
  return b;
}

TEST(Lights, PointTakesPositionAndCandela)
{
  const Scene scene =
      load(lit_by({{"type", "point"}, {"intensity", 20}, {"color", {1, 0.5, 0}}}, {{"translation", {1, 2, 3}}}));
  const Light& l = scene.lights.at(0);
  EXPECT_EQ(l.kind, LightKind::kPoint);
  EXPECT_EQ(l.P, (Vec3f{1, 2, 3}));
  EXPECT_EQ(l.emission, (Vec3f{20, 10, 0}));
  EXPECT_TRUE(is_zero(scene.environment.color));
}

TEST(Lights, LuminousEfficacyDividesCandelaAndLux)
{
  GltfBuilder b = lit_by({{"type", "directional"}, {"intensity", 683}});
  b.json["extensions"]["RELIEF_render"]["luminousEfficacy"] = 683;
  EXPECT_FLOAT_EQ(load(b).lights.at(0).emission.x, 1.0f);
}

// Quarter turn about x takes −z to −... a light that looked along −z now looks along +y.
TEST(Lights, SpotLooksAlongItsNodesMinusZ)
{
  const double s = std::sqrt(0.5);
  const Scene scene = load(lit_by({{"type", "spot"}, {"spot", {{"innerConeAngle", 0.2}, {"outerConeAngle", 0.4}}}},
                                  {{"rotation", {s, 0, 0, s}}, {"scale", {3, 3, 3}}}));
  const Light& l = scene.lights.at(0);
  expect_near(l.axis, {0, 1, 0});
  EXPECT_FLOAT_EQ(l.cos_inner, std::cos(0.2f));
  EXPECT_FLOAT_EQ(l.cos_outer, std::cos(0.4f));
}

TEST(Lights, RadiusAndFalloffAreExtensionsOfOurOwn)
{
  const auto spot = [](const json& ours) {
    return load(lit_by({{"type", "spot"},
                        {"spot", {{"innerConeAngle", 0.2}, {"outerConeAngle", 0.4}}},
                        {"extensions", {{"RELIEF_light", ours}}}},
                       {{"scale", {3, 3, 3}}}))
        .lights.at(0);
  };
  EXPECT_EQ(spot(json::object()).radius, 0.0f);
  EXPECT_EQ(spot(json::object()).falloff, SpotFalloff::kSquare);
  EXPECT_EQ(spot({{"radius", 0.25}}).radius, 0.25f);
  EXPECT_EQ(spot({{"falloff", "smooth-cosine"}}).falloff, SpotFalloff::kSmoothCosine);
  EXPECT_THROW(spot({{"radius", -1}}), SceneError);
  EXPECT_THROW(spot({{"radius", 1e16}}), SceneError);
  EXPECT_EQ(spot({{"radius", 1e-12}}).radius, 0.0f) << "its square would leave single precision";
  EXPECT_FALSE(spot({{"radius", 1}}).faces_viewer || spot({{"radius", 1}}).visible_to_camera);
  EXPECT_TRUE(spot({{"radius", 1}, {"shape", "disk"}}).faces_viewer);
  EXPECT_TRUE(spot({{"radius", 1}, {"visibleToCamera", true}}).visible_to_camera);
  EXPECT_THROW(spot({{"shape", "cube"}}), SceneError);
  EXPECT_THROW(spot({{"falloff", "linear"}}), SceneError);
}

// A node's scale says nothing about where its light looks, however small.
TEST(Lights, DirectionsSurviveTinyScales)
{
  const Scene scene =
      load(lit_by({{"type", "directional"}}, {{"rotation", {0, 1, 0, 0}}, {"scale", {1e-25, 1e-25, 1e-25}}}));
  expect_near(scene.lights.at(0).axis, {0, 0, 1});
}

TEST(Lights, RectanglePowerIsSpreadOverItsAreaInTheWorld)
{
  GltfBuilder b = test::square_scene();
  b.root_node({{"translation", {0, 5, 0}},
               {"scale", {2, 3, 1}},
               {"extensions",
                {{"RELIEF_area_light",
                  {{"width", 4}, {"height", 1}, {"power", 12}, {"twoSided", true}, {"color", {1, 0, 0}}}}}}});
  const Scene scene = load(b);
  const Light& l = scene.lights.at(0);
  EXPECT_EQ(l.kind, LightKind::kRectangle);
  expect_near(l.edge_u, {4, 0, 0});
  expect_near(l.edge_v, {0, 1.5f, 0});
  EXPECT_FLOAT_EQ(l.area, 24);
  expect_near(l.axis, {0, 0, -1});
  EXPECT_FLOAT_EQ(l.emission.x, 12 / (kPi * 24 * 2));
  EXPECT_EQ(l.emission.y, 0);
}

TEST(Lights, GraphsAreLampsUnlessTheyAreConstants)
{
  GltfBuilder b = test::square_scene();
  const json reads = {{"nodes", {{{"type", "light-falloff"}, {"inputs", {{"strength", 3}}}}}},
                      {"outputs", {{"emission", {{"node", 0}, {"output", "linear"}}}}}};
  json constant = reads;
  constant["outputs"]["emission"]["output"] = "quadratic";
  b.root_node(
      {{"translation", {1, 2, 3}}, {"extensions", {{"RELIEF_area_light", {{"radiance", 2}, {"graph", reads}}}}}});
  b.root_node({{"extensions",
                {{"RELIEF_area_light", {{"radiance", 2}, {"graph", constant}, {"spread", 1.5707963267948966}}}}}});
  const Scene scene = load(b);
  ASSERT_EQ(scene.lights.size(), 2u);
  ASSERT_EQ(scene.lamps.size(), 1u);
  EXPECT_EQ(scene.lights[0].lamp_index, 0);
  EXPECT_FALSE(scene.lights[0].is_even);
  expect_near(scene.lamps[0].node.world_from_object.p, {1, 2, 3});
  EXPECT_EQ(scene.lights[1].lamp_index, -1);
  EXPECT_TRUE(scene.lights[1].is_even);
  EXPECT_EQ(scene.lights[1].emission, (Vec3f{6, 6, 6}));
  EXPECT_FLOAT_EQ(scene.lights[1].spread_tan, 1);
  EXPECT_EQ(scene.lights[0].spread_tan, 0);
}

TEST(Lights, DiskOfAMirroredNodeStillShinesAlongMinusZ)
{
  GltfBuilder b = test::square_scene();
  b.root_node(
      {{"scale", {-1, 1, 1}},
       {"extensions",
        {{"RELIEF_area_light", {{"shape", "disk"}, {"radius", 2}, {"radiance", 7}, {"visibleToCamera", false}}}}}});
  const Light l = load(b).lights.at(0);
  EXPECT_EQ(l.kind, LightKind::kDisk);
  EXPECT_FLOAT_EQ(l.area, 4 * kPi);
  expect_near(l.axis, {0, 0, -1});
  EXPECT_EQ(l.emission, (Vec3f{7, 7, 7}));
  EXPECT_FALSE(l.visible_to_camera);
}

TEST(Environments, ConstantAndMap)
{
  GltfBuilder b = test::square_scene();
  b.json["extensions"]["RELIEF_environment"] = {
      {"color", {1, 0.5, 0}}, {"strength", 4}, {"rotation", 1.5}, {"visibleToCamera", false}};
  const Scene constant = load(b);
  EXPECT_EQ(constant.environment.color, (Vec3f{4, 2, 0}));
  EXPECT_EQ(constant.environment.rotation, 1.5f);
  EXPECT_FALSE(constant.environment.visible_to_camera);
  EXPECT_EQ(constant.environment.texture_index, -1);
  b.json["images"] = {{{"uri", test::kPixelPng}}};
  b.json["extensions"]["RELIEF_environment"]["image"] = 0;
  const Scene map = load(b);
  EXPECT_GE(map.environment.texture_index, 0);
  EXPECT_EQ(map.textures->views()[0].wrap_u, Wrap::kRepeat);
  EXPECT_EQ(map.textures->views()[0].wrap_v, Wrap::kClamp);
}

// --- cameras ---

TEST(Cameras, PerspectiveHalfHeightIsTheTangentOfHalfTheField)
{
  GltfBuilder b = test::square_scene();
  b.json["cameras"] = {
      {{"type", "perspective"},
       {"perspective", {{"yfov", 1.0}, {"aspectRatio", 2.0}, {"znear", 0.1}}},
       {"extensions",
        {{"RELIEF_camera",
          {{"apertureRadius", 0.02}, {"focusDistance", 3}, {"shift", {0.1, -0.2}}, {"clip", {0.5}}}}}}}};
  b.root_node({{"name", "eye"}, {"camera", 0}, {"translation", {0, 0, 5}}, {"scale", {2, 2, 2}}});
  const Scene scene = load(b);
  const SceneCamera& c = scene.cameras.at(0);
  EXPECT_EQ(c.name, "eye");
  EXPECT_EQ(c.aspect, 2.0f);
  EXPECT_FLOAT_EQ(c.camera.half_height, std::tan(0.5f));
  EXPECT_FLOAT_EQ(c.camera.half_width, 2 * std::tan(0.5f));
  EXPECT_EQ(c.camera.world_from_camera.p, (Vec3f{0, 0, 5}));
  expect_near(c.camera.world_from_camera.x, {1, 0, 0});  // no scale
  EXPECT_EQ(c.camera.aperture_radius, 0.02f);
  EXPECT_EQ(c.camera.focus_distance, 3);
  EXPECT_EQ(c.camera.shift_y, -0.2f);
  EXPECT_EQ(c.camera.clip_start, 0.5f);
  EXPECT_EQ(c.camera.clip_end, kInfinity);
}

TEST(Cameras, OrthographicKeepsItsSizes)
{
  GltfBuilder b = test::square_scene();
  b.json["cameras"] = {
      {{"type", "orthographic"}, {"orthographic", {{"xmag", 3}, {"ymag", 2}, {"znear", 0}, {"zfar", 10}}}}};
  b.root_node({{"camera", 0}});
  const SceneCamera c = load(b).cameras.at(0);
  EXPECT_EQ(c.camera.projection, Projection::kOrthographic);
  EXPECT_FLOAT_EQ(c.camera.half_height, 2);
  EXPECT_FLOAT_EQ(c.camera.half_width, 3);
}

// --- settings ---

TEST(RenderSettings, AreRead)
{
  GltfBuilder b = test::square_scene();
  b.json["extensions"]["RELIEF_render"] = {{"resolution", {640, 480}},
                                           {"samples", 9},
                                           {"noiseThreshold", 0.01},
                                           {"maxBounces", 5},
                                           {"glossyBounces", 2},
                                           {"transparentBounces", 7},
                                           {"seed", 42},
                                           {"view", "Filmic"},
                                           {"exposure", -1},
                                           {"clampIndirect", 3},
                                           {"frameRange", {2, 8}},
                                           {"fps", 30},
                                           {"pixelFilter", {{"type", "box"}}},
                                           {"caustics", json::object()},
                                           {"colour", 1}};
  const Scene scene = load(b);
  const RenderSettings& s = scene.render;
  EXPECT_EQ(s.width, 640);
  EXPECT_EQ(s.height, 480);
  EXPECT_EQ(s.samples, 9);
  EXPECT_EQ(s.noise_threshold, 0.01f);
  EXPECT_EQ(s.max_bounces, 5);
  EXPECT_EQ(s.diffuse_bounces, 5);  // follows maxBounces
  EXPECT_EQ(s.glossy_bounces, 2);
  EXPECT_EQ(s.transparent_bounces, 7);
  EXPECT_EQ(s.seed, 42u);
  EXPECT_EQ(s.view, "Filmic");
  EXPECT_EQ(s.exposure, -1);
  EXPECT_EQ(s.clamp_indirect, 3);
  EXPECT_EQ(s.frame_start, 2);
  EXPECT_EQ(s.frame_end, 8);
  EXPECT_EQ(s.frames_per_second, 30);
  EXPECT_EQ(s.filter, PixelFilter::kBox);
  EXPECT_TRUE(has_warning(scene, "/extensions/RELIEF_render/colour"));
}

TEST(Diagnostics, WarningsAreCountedAndErrorsAreOneLine)
{
  Warnings w;
  w.add("b");
  w.add("a");
  w.add("b");
  EXPECT_EQ(w.texts(), (std::vector<std::string>{"b (×2)", "a"}));
  const SceneError e("f\n.gltf", "/a", "x\ty", std::string(5000, 'z'));
  const std::string text = e.what();
  EXPECT_EQ(text.find('\n'), std::string::npos);
  EXPECT_EQ(text.find('\t'), std::string::npos);
  EXPECT_LT(text.size(), 1000u);
  EXPECT_NE(text.find("f\\x0a.gltf: /a: expected x\\x09y, found zz"), std::string::npos);
}

}  // namespace
}  // namespace relief
