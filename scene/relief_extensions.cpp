#include "scene/relief_extensions.h"

#include "kernel/graph/graph_scene.h"
#include "kernel/shape/mesh_view.h"
#include "kernel/state/path_event.h"

#include <algorithm>
#include <cmath>
#include <initializer_list>

#include "scene/graph/graph_reader.h"
#include "scene/limits.h"
#include "scene/setting_values.h"

namespace relief {
namespace {

constexpr double kNoLimit = JsonReader::kNoLimit;

/// Environment::hidden_from, or Light's.
/// @param inherited  what it is where nothing is said
std::uint32_t read_hidden_from(const JsonReader& r, std::uint32_t inherited = 0)
{
  static constexpr std::pair<std::string_view, std::uint32_t> kRays[] = {
      {"visibleToDiffuse", 1u << static_cast<std::uint32_t>(PathEvent::kDiffuse)},
      {"visibleToGlossy", 1u << static_cast<std::uint32_t>(PathEvent::kGlossy)},
      {"visibleToTransmission", 1u << static_cast<std::uint32_t>(PathEvent::kTransmission)},
      {"visibleToScattered", kHiddenFromScattered}};
  std::uint32_t hidden = 0;
  for (const auto& [name, bit] : kRays) {
    if (!r.boolean(name, (inherited & bit) == 0)) hidden |= bit;
  }
  return hidden;
}

/// The name of a group of lights.
std::string read_light_group(const JsonReader& r, const std::string& inherited = {})
{
  constexpr std::size_t kLongest = 200;  // OpenEXR's channels have names of 255 bytes
  std::string name = r.string("lightGroup", inherited);
  if (name.size() > kLongest) r.fail("lightGroup", "a name of at most 200 bytes");
  return name;
}

EnvironmentGraph read_environment_graph(const GltfDocument& document,
                                        const JsonReader& r,
                                        TextureTable& textures,
                                        bool has_backdrop,
                                        Warnings& warnings)
{
  EnvironmentGraph graph;
  graph.program = graph_read_color(document, r, textures, graph.suns, warnings);
  r.warn_unread(warnings);
  using Q = GraphQuantity;
  const auto reads = [&graph](std::initializer_list<Q> quantities) {
    return std::any_of(graph.program.inputs.begin(), graph.program.inputs.end(), [&](const GraphInput& input) {
      return std::find(quantities.begin(), quantities.end(), input.quantity) != quantities.end();
    });
  };
  const std::string place = r.file() + ": " + r.path();
  const auto asks = [&graph](auto&& of) {
    return std::any_of(graph.program.inputs.begin(), graph.program.inputs.end(), of);
  };
  const bool asks_for_others = asks([has_backdrop](const GraphInput& input) {
    return input.quantity == Q::ray_kind && (!has_backdrop || input.index != static_cast<int>(GraphRayKind::kCamera));
  });
  if (asks_for_others || reads({Q::ray_depth, Q::ray_length})) {
    warnings.add(place + ": all rays" + (has_backdrop ? " but the camera's" : "") +
                 " see the same surroundings: those of a ray of no kind");
  }
  if (reads({Q::camera_from_world, Q::world_from_camera, Q::window_x, Q::window_y})) {
    warnings.add(place + ": surroundings do not depend on the camera: its coordinates are 0");
  }
  return graph;
}

/// Vector of the node scaled by a length, for the half axes of an area light.
Vec3f half_axis(Vec3f axis, float size) { return axis * (0.5f * size); }

/// Reads one of the two ways of giving the height map: a glTF texture or a plain path.
TextureRef height_texture(const GltfDocument& document,
                          const JsonReader& parent,
                          std::string_view name,
                          TextureTable& height_maps,
                          Warnings& warnings)
{
  if (!parent.has(name)) {
    return {};
  }
  const JsonReader info = parent.object(name);
  if (!info.has("uri")) {
    const TextureRef ref = khronos_texture_ref(document, parent, name, TextureColor::kLinear, height_maps, warnings);
    for (const char* known : {"index", "texCoord"}) {
      static_cast<void>(info.has(known));
    }
    info.warn_unread(warnings);
    return ref;
  }
  if (info.has("index")) {
    info.fail("", "either index or uri", "both");
  }
  TextureRef ref;
  ref.uv_set = static_cast<int>(info.integer("texCoord", 0, 0, 1));
  document.read_extension(parent.raw(name), info.path(), "KHR_texture_transform",
                          [&](const JsonReader& r) { khronos_texture_transform(ref, r, warnings); });
  const std::string uri = info.string("uri", "");
  ref.texture_index =
      height_maps.add_file(document, uri, json_path_join(info.path(), "uri"), TextureColor::kLinear, {});
  info.warn_unread(warnings);
  return ref;
}

/// A power of two.
std::int32_t read_num_cells(const JsonReader& r, const char* name, const char* expected)
{
  const bool is_number = r.raw(name).is_number();
  const std::int64_t cells = is_number ? r.integer(name, 1, 1, kMostHeightCells) : 0;
  if (!is_number || (cells & (cells - 1)) != 0) r.fail(name, expected);
  return static_cast<std::int32_t>(cells);
}

/// How fine computed heights are, and maps that are diced.
void read_cells(const JsonReader& r, DisplacementSettings& d, Warnings& warnings)
{
  d.cell_pixels = r.number_f("cellPixels", 1, 0.01, 1e3);
  d.coarser_outside = r.number_f("coarserOutside", 4, 1, 1e3);
  d.divide = r.boolean("divide", false);
  if (!displacement_is_computed(d)) {
    for (const char* name : {"cells", "cellLength", "mostCells"}) {
      if (!r.has(name)) continue;
      static_cast<void>(r.raw(name));
      warnings.add(r.file() + ": " + json_path_join(r.path(), name) +
                   ": of heights that are computed; these have a map");
    }
    return;
  }
  if (r.has("cells") && !(r.raw("cells").is_string() && r.string("cells", "") == "auto"))
    d.num_cells = read_num_cells(r, "cells", "\"auto\" or a power of two up to 524288");
  if (r.has("mostCells")) d.most_cells = read_num_cells(r, "mostCells", "a power of two up to 524288");
  if (r.has("cellLength")) d.cell_length = r.number_f("cellLength", 1, 1e-12, 1e12);
}

/// Where the heights or vectors of a displacement come from: one of these, or with `curved` none.
/// @return  its name; empty: none
std::string displacement_source(const JsonReader& r)
{
  std::string found;
  for (const char* name : {"heightTexture", "heightGraph", "vectorTexture", "vectorGraph"}) {
    if (!r.has(name)) continue;
    if (!found.empty()) r.fail("", "either " + found + " or " + name, "both");
    found = name;
  }
  return found;
}

/// @param material  as warnings name it
DisplacementSettings read_displacement(const GltfDocument& document,
                                       const JsonReader& r,
                                       const std::string& material,
                                       TextureTable& height_maps,
                                       HeightGraphTable& height_graphs,
                                       Warnings& warnings)
{
  static constexpr std::string_view kSpaces[] = {"object", "world"};
  static constexpr std::string_view kSeams[] = {"keep", "weld"};
  DisplacementSettings d;
  const std::string source = displacement_source(r);
  d.has_graph = source == "heightGraph";
  d.by_vectors = source.starts_with("vector");
  if (d.by_vectors) {
    d.graph_index = height_graphs.add_vectors(document, r, warnings);
    d.midlevel = 0;
  } else {
    d.height = height_texture(document, r, "heightTexture", height_maps, warnings);
    d.scale = r.number_f("scale", 1);
    d.midlevel = r.number_f("midlevel", 0.5f);
    d.space = static_cast<DisplacementSpace>(r.choice("space", kSpaces, 0));
  }
  d.method = static_cast<DisplacementMethod>(r.choice("method", kDisplacementMethodLabels, 0));
  if (r.has("lod") && r.raw("lod").is_string() && r.string("lod", "") == "auto") {
    d.lod = -1;
  } else if (r.has("lod")) {
    if (!r.raw("lod").is_number()) {
      r.fail("lod", "\"auto\" or a number ≥ 0");
    }
    d.lod = r.number_f("lod", 0, 0, kNoLimit);
  }
  d.smoothing = r.boolean("smoothing", false);
  d.weld_seams = r.choice("seams", kSeams, 0) == 1;
  d.curved = r.boolean("curved", false);
  if (d.by_vectors && d.curved) r.fail("curved", "false, as points move by vectors", "true");
  if (source.empty() && !d.curved) {
    r.fail("", "a heightTexture, heightGraph, vectorTexture or vectorGraph, or curved", "none");
  }
  if (d.has_graph) {
    const HeightGraph graph = height_graphs.add(document, r, material, warnings);
    d.height = graph.map;
    d.graph_index = graph.graph_index;
  }
  read_cells(r, d, warnings);
  r.warn_unread(warnings);
  return d;
}

/// The unofficial extension stores offset + factor · h along the normal; ours is scale · (h − midlevel).
DisplacementSettings read_khr_displacement(const GltfDocument& document,
                                           const JsonReader& r,
                                           TextureTable& height_maps,
                                           Warnings& warnings)
{
  DisplacementSettings d;
  const char* name = r.has("displacementGeometryTexture") ? "displacementGeometryTexture" : "displacementTexture";
  d.height = height_texture(document, r, name, height_maps, warnings);
  if (d.height.texture_index < 0) {
    r.fail("displacementGeometryTexture", "a texture");
  }
  d.scale = r.number_f("displacementGeometryFactor", 1);
  const float offset = r.number_f("displacementGeometryOffset", 0);
  d.midlevel = offset != 0 ? -offset / d.scale : 0.0f;
  if (!is_finite(d.midlevel)) {
    r.fail("displacementGeometryOffset", "0, because displacementGeometryFactor is");
  }
  r.warn_unread(warnings);
  return d;
}

}  // namespace

RenderSettings relief_render(const GltfDocument& document, Warnings& warnings)
{
  RenderSettings s;
  document.read_extension(document.json, "", "RELIEF_render",
                          [&](const JsonReader& r) { s = render_settings_read(r, warnings); });
  return s;
}

namespace {

constexpr std::string_view kPanoramaLabels[] = {"equirectangular", "cylindrical", "equidistant", "equisolid",
                                                "polynomial",      "mirror-ball", "cube-face"};

/// Two different numbers.
void read_range(const JsonReader& r, const char* name, double most, float& first, float& last)
{
  const std::vector<double> ends = r.numbers(name, 2, 2, -most, most);
  if (ends.empty()) return;
  first = static_cast<float>(ends[0]);
  last = static_cast<float>(ends[1]);
  if (first == last) r.fail(name, "two different numbers");
}

/// What fisheyes say of their lens and sensor.
void read_fisheye(const JsonReader& r, Panorama& p)
{
  constexpr double kMostField = 100, kLeastLength = 1e-3, kMostLength = 1e6;  // radians, millimetres
  p.half_field = 0.5f * r.number_f("fieldOfView", 2.0f * p.half_field, 1e-3, kMostField);
  if (p.kind == PanoramaKind::kEquidistant) return;
  const std::vector<double> sensor = r.numbers("sensor", 2, 2, kLeastLength, kMostLength);
  if (!sensor.empty()) {
    p.half_sensor_width = static_cast<float>(0.5 * sensor[0]);
    p.half_sensor_height = static_cast<float>(0.5 * sensor[1]);
  }
  if (p.kind == PanoramaKind::kEquisolid) {
    p.focal_length = r.number_f("focalLength", p.focal_length, kLeastLength, kMostLength);
    return;
  }
  constexpr std::size_t kCount = std::size(Panorama{}.k);
  const std::vector<double> k = r.numbers("coefficients", kCount, kCount, -1e6, 1e6);
  if (k.empty()) r.fail("coefficients", "five numbers");
  for (std::size_t i = 0; i < kCount; ++i) p.k[i] = static_cast<float>(k[i]);
}

/// Makes a camera a panoramic one.
void read_panorama(const JsonReader& r, Camera& camera, Warnings& warnings)
{
  Panorama& p = camera.panorama;
  camera.projection = Projection::kPanoramic;
  p.kind = static_cast<PanoramaKind>(r.choice("type", kPanoramaLabels, static_cast<int>(p.kind)));
  constexpr double kMostAngle = 100, kMostHeight = 1e6;
  switch (p.kind) {
    case PanoramaKind::kEquirectangular:
      read_range(r, "longitude", kMostAngle, p.longitude_min, p.longitude_max);
      read_range(r, "latitude", kMostAngle, p.latitude_min, p.latitude_max);
      break;
    case PanoramaKind::kCylindrical:
      read_range(r, "longitude", kMostAngle, p.longitude_min, p.longitude_max);
      read_range(r, "heights", kMostHeight, p.height_min, p.height_max);
      break;
    case PanoramaKind::kEquidistant:
    case PanoramaKind::kEquisolid:
    case PanoramaKind::kPolynomial:
      read_fisheye(r, p);
      break;
    case PanoramaKind::kMirrorBall:
    case PanoramaKind::kCubeFace:
      break;
  }
  camera.half_width = camera.half_height = 1;
  const std::vector<double> window = r.numbers("window", 2, 2, 1e-6, 1e6);
  if (!window.empty()) {
    camera.half_width = static_cast<float>(window[0]);
    camera.half_height = static_cast<float>(window[1]);
  }
  r.warn_unread(warnings);
}

}  // namespace

void relief_camera(const GltfDocument& document, int camera_index, Camera& camera, Shutter& shutter, Warnings& warnings)
{
  constexpr int kMostBlades = 1000;
  constexpr double kMostTurns = 1e4;  // radians, of which the kernel takes sines in single precision
  const auto index = static_cast<std::size_t>(camera_index);
  const std::string path = "/cameras/" + std::to_string(index);
  document.read_extension(document.element("cameras", index), path, "RELIEF_camera", [&](const JsonReader& r) {
    if (r.has("panorama")) {
      if (camera.projection != Projection::kPerspective)
        r.fail("panorama", "a perspective camera that it is of", "another");
      read_panorama(r.object("panorama"), camera, warnings);
    } else {
      camera.pixel_aspect = r.number_f("pixelAspect", 1, 1e-3, 1e3);
      camera.half_width *= camera.pixel_aspect;
    }
    camera.aperture_radius = r.number_f("apertureRadius", 0, 0, kFarthest);
    camera.aperture_blades = static_cast<int>(r.integer("apertureBlades", 0, 0, kMostBlades));
    camera.aperture_rotation = r.number_f("apertureRotation", 0, -kMostTurns, kMostTurns);
    camera.aperture_ratio = r.number_f("apertureRatio", 1, 1e-6, 1e6);
    if (!(camera.aperture_radius / camera.aperture_ratio <= kFarthest)) {
      r.fail("apertureRatio", "an aperture within 1e15 m");
    }
    camera.focus_distance = r.number_f("focusDistance", 1, 1e-6, kNoLimit);
    const float reach = camera.projection == Projection::kPerspective
                            ? camera.focus_distance * max(1.0f, max(camera.half_width, camera.half_height))
                            : camera.focus_distance;
    if (camera.aperture_radius > 0 && !(reach <= kFarthest)) {
      r.fail("focusDistance", "a distance at which all that is in focus is within 1e15 m");
    }
    const std::vector<double> shift = r.numbers("shift", 2, 2, -1e3, 1e3);
    if (!shift.empty()) {
      camera.shift_x = static_cast<float>(shift[0]);
      camera.shift_y = static_cast<float>(shift[1]);
    }
    const std::vector<double> clip = r.numbers("clip", 1, 2, 0, 1e30);
    if (!clip.empty()) {
      camera.clip_start = static_cast<float>(clip[0]);
      camera.clip_end = clip.size() == 2 ? static_cast<float>(clip[1]) : kInfinity;
      if (!(camera.clip_end > camera.clip_start)) {
        r.fail("clip", "an end beyond the start");
      }
    }
    shutter.frames = r.number_f("shutter", 0, 0, kLongestShutter);
    shutter.position = static_cast<ShutterPosition>(
        r.choice("shutterPosition", kShutterPositionLabels, static_cast<int>(shutter.position)));
    shutter.steps = static_cast<int>(r.integer("shutterSteps", shutter.steps, 1, kMostShutterSteps));
    r.warn_unread(warnings);
  });
}

namespace {

/// A colour, a map or a graph.
/// @param has_backdrop  the camera sees others
Surroundings read_surroundings(const GltfDocument& document,
                               const JsonReader& r,
                               TextureTable& textures,
                               bool has_backdrop,
                               Warnings& warnings)
{
  Surroundings s;
  s.color = r.color("color", {1, 1, 1}) * r.number_f("strength", 1, 0, kNoLimit);
  if (!is_finite(s.color)) {
    r.fail("strength", "a finite radiance");
  }
  s.rotation = r.number_f("rotation", 0, -1e6, 1e6);
  if (r.has("image") && r.has("uri")) {
    r.fail("", "either image or uri", "both");
  }
  if (r.has("graph")) {
    if (r.has("image") || r.has("uri")) r.fail("", "either a graph or a map", "both");
    s.graph = read_environment_graph(document, r.object("graph"), textures, has_backdrop, warnings);
  }
  // Round about there is no border; at the poles there is.
  const TextureSampling lat_long{Wrap::kRepeat, Wrap::kClamp, TexelFilter::kLinear};
  if (const int image = r.index("image", document.count("images"), "images"); image >= 0) {
    s.texture_index = textures.add_image(document, image, TextureColor::kSrgb, lat_long);
  } else if (r.has("uri")) {
    s.texture_index = textures.add_file(document, r.string("uri", ""), json_path_join(r.path(), "uri"),
                                        TextureColor::kSrgb, lat_long);
  }
  return s;
}

}  // namespace

std::uint32_t light_group_number(std::vector<std::string>& names,
                                 const std::string& name,
                                 const std::string& file,
                                 const std::string& path)
{
  if (name.empty()) return 0;
  const auto place = std::find(names.begin(), names.end(), name);
  const auto number = static_cast<std::uint32_t>(place - names.begin()) + 1;
  if (number > kMostLightGroups) {
    throw SceneError(file, json_path_join(path, "lightGroup"),
                     "at most " + std::to_string(kMostLightGroups) + " groups of lights", "more");
  }
  if (place == names.end()) names.push_back(name);
  return number;
}

std::optional<Environment> relief_environment(const GltfDocument& document,
                                              TextureTable& textures,
                                              std::vector<std::string>& light_groups,
                                              Warnings& warnings)
{
  std::optional<Environment> out;
  document.read_extension(document.json, "", "RELIEF_environment", [&](const JsonReader& r) {
    Environment e;
    static_cast<Surroundings&>(e) =
        read_surroundings(document, r, textures, r.has("backdrop"), warnings);
    e.visible_to_camera = r.boolean("visibleToCamera", true);
    e.casts_caustics = r.boolean("causticLight", true);
    e.hidden_from = read_hidden_from(r);
    e.light_group = light_group_number(light_groups, read_light_group(r), r.file(), r.path());
    if (r.has("volume")) {
      const JsonReader volume = r.object("volume");
      VolumeProgram medium = volume_read(document, volume, textures, warnings);
      const bool is_even = medium_is_even(medium);
      for (const int texture : graph_textures(medium.program)) textures.use_for_heights(texture);
      e.medium = is_even ? medium_of(medium) : Medium{};
      if (!is_even) e.varying_medium = std::move(medium);
    }
    if (r.has("clearGlass")) e.clear_roughness = r.number_f("clearGlass", 0, 0, 1);
    if (r.has("backdrop")) {
      const JsonReader backdrop = r.object("backdrop");
      e.backdrop = read_surroundings(document, backdrop, textures, true, warnings);
      if (e.backdrop->graph) e.backdrop->graph->is_backdrop = true;
      backdrop.warn_unread(warnings);
    }
    r.warn_unread(warnings);
    out = e;
  });
  return out;
}

namespace {

void read_lamp_graph(const JsonReader& r, const LampGraphReader& read_graph, Light& light)
{
  if (!r.has("graph")) return;
  light.lamp_index = read_graph(r.object("graph"));
  light.is_even = false;
}

/// The full angle within which a flat light shines; its power stays the same.
void read_spread(const JsonReader& r, Light& light)
{
  // Narrower ones are hardly ever seen from anywhere, which is all noise.
  constexpr double kNarrowest = 0.0174, kHalfTurn = 3.1415926535897932;
  const double spread = r.number("spread", kHalfTurn, kNarrowest, kHalfTurn + 1e-6);
  constexpr double kWidest = kHalfTurn - 1e-4;
  if (spread > kWidest) return;
  const double tangent = std::tan(spread / 2);
  light.spread_tan = static_cast<float>(tangent);
  light.spread_scale = static_cast<float>(1 / (tangent - spread / 2));
}

}  // namespace

void relief_light(const GltfDocument& document,
                  const nlohmann::json& value,
                  const std::string& path,
                  const LampGraphReader& read_graph,
                  Light& light,
                  Warnings& warnings)
{
  static constexpr std::string_view kFalloffs[] = {"square", "smooth", "smooth-cosine"};
  static constexpr std::string_view kShapes[] = {"ball", "disk"};
  document.read_extension(value, path, "RELIEF_light", [&](const JsonReader& r) {
    if (light_is_sun(light)) {
      // The widest that has a side to shine from; as one minus the cosine of half of it, without that one's digits.
      constexpr double kWidest = 3.1415;
      const double half_sine = std::sin(r.number("angle", 0, 0, kWidest) / 4);
      light.cone = static_cast<float>(2 * half_sine * half_sine);
      // So narrow a sun is a point; its radiance leaves single precision.
      constexpr float kNarrowest = 1e-14f;
      if (light.cone < kNarrowest) light.cone = 0;
      light.faces_viewer = r.choice("shape", kShapes, 0) == 1;
      light.visible_to_camera = r.boolean("visibleToCamera", false);
    } else {
      light.radius = r.number_f("radius", 0, 0, kFarthest);
      // Its square would leave single precision; so small a ball is a point.
      constexpr float kSmallestRadius = 1e-9f;
      if (light.radius < kSmallestRadius) light.radius = 0;
      light.faces_viewer = r.choice("shape", kShapes, 0) == 1;
      light.visible_to_camera = r.boolean("visibleToCamera", false);
    }
    if (light.kind == LightKind::kSpot) light.falloff = static_cast<SpotFalloff>(r.choice("falloff", kFalloffs, 0));
    read_lamp_graph(r, read_graph, light);
    r.warn_unread(warnings);
  });
}

std::vector<Light> relief_area_light(const GltfDocument& document,
                                     int node_index,
                                     const Transform& world,
                                     const LampGraphReader& read_graph,
                                     Warnings& warnings)
{
  static constexpr std::string_view kShapes[] = {"rectangle", "disk"};
  std::vector<Light> out;
  const auto index = static_cast<std::size_t>(node_index);
  const std::string path = "/nodes/" + std::to_string(index);
  document.read_extension(document.element("nodes", index), path, "RELIEF_area_light", [&](const JsonReader& r) {
    const Affine3 m = transform_to_affine(world);
    const bool disk = r.choice("shape", kShapes, 0) == 1;
    constexpr double kSmallest = 1e-9;
    Light light;
    light.kind = disk ? LightKind::kDisk : LightKind::kRectangle;
    const float diameter = disk ? 2 * r.number_f("radius", 0.5f, kSmallest, kNoLimit) : 0;
    light.edge_u = half_axis(m.x, disk ? diameter : r.number_f("width", 1, kSmallest, kNoLimit));
    light.edge_v = half_axis(m.y, disk ? diameter : r.number_f("height", 1, kSmallest, kNoLimit));
    light.P = m.p;
    const Vec3f across = cross(light.edge_u, light.edge_v);
    light.area = length(across) * (disk ? kPi : 4.0f);
    // Below, 1 / area and the radiance that belongs to it leave single precision.
    constexpr float kSmallestArea = 1e-20f;
    if (!(light.area >= kSmallestArea && is_finite(light.area))) {
      r.fail("", "a light of at least 1e-20 m² in the world", number_text(static_cast<double>(light.area)));
    }
    const Vec3f normal = normalize(across);
    // A mirroring node turns the edges' winding over, but the light still shines along the node's −Z.
    light.axis = dot(normal, m.z) > 0 ? -normal : normal;
    light.two_sided = r.boolean("twoSided", false);
    light.visible_to_camera = r.boolean("visibleToCamera", true);
    const Vec3f color = r.color("color", {1, 1, 1});
    if (r.has("power") == r.has("radiance")) {
      r.fail("", "exactly one of power and radiance", r.has("power") ? "both" : "neither");
    }
    const float sides = light.two_sided ? 2.0f : 1.0f;
    light.emission = r.has("radiance") ? color * r.number_f("radiance", 0, 0, kNoLimit)
                                       : color * (r.number_f("power", 0, 0, kNoLimit) / (kPi * light.area * sides));
    if (!is_finite(light.emission)) {
      r.fail("", "a finite radiance", "one beyond single precision");
    }
    read_spread(r, light);
    read_lamp_graph(r, read_graph, light);
    r.warn_unread(warnings);
    out.push_back(light);
  });
  return out;
}

namespace {

/// RELIEF_object's values: a number each, or two to four.
/// @param inherited  the parent's; null: none
std::shared_ptr<const std::map<std::string, std::array<float, 4>>> read_object_values(
    const JsonReader& object,
    const std::map<std::string, std::array<float, 4>>* inherited)
{
  auto out = std::make_shared<std::map<std::string, std::array<float, 4>>>();
  if (inherited != nullptr) *out = *inherited;
  const JsonReader values = object.object("values");
  for (const auto& [name, json] : object.raw("values").items()) {
    if (json.is_number()) {
      const float value = values.number_f(name, 0);
      (*out)[name] = {value, value, value, 1};
      continue;
    }
    if (!json.is_array()) values.fail(name, "a number, or two to four numbers", json_describe(json));
    std::array<float, 4> value{0, 0, 0, 1};
    const std::vector<double> numbers = values.numbers(name, 2, 4, -1e30, 1e30);
    for (std::size_t c = 0; c < numbers.size(); ++c) value[c] = static_cast<float>(numbers[c]);
    (*out)[name] = value;
  }
  return out;
}

}  // namespace

ObjectSettings relief_object(const GltfDocument& document, int node_index, ObjectSettings inherited, Warnings& warnings)
{
  ObjectSettings s = inherited;
  const auto index = static_cast<std::size_t>(node_index);
  const std::string path = "/nodes/" + std::to_string(index);
  document.read_extension(document.element("nodes", index), path, "RELIEF_object", [&](const JsonReader& r) {
    s.visible_to_camera = r.boolean("visibleToCamera", s.visible_to_camera);
    s.casts_shadow = r.boolean("castsShadow", s.casts_shadow);
    s.caustic_receiver = r.boolean("causticReceiver", s.caustic_receiver);
    s.caustic_light = r.boolean("causticLight", s.caustic_light);
    s.multiple_importance = r.boolean("multipleImportance", s.multiple_importance);
    s.holdout = r.boolean("holdout", s.holdout);
    s.shadow_catcher = r.boolean("shadowCatcher", s.shadow_catcher);
    s.light_group = read_light_group(r, s.light_group);
    s.lights_footage = r.boolean("lightsFootage", s.lights_footage);
    s.hidden_from = read_hidden_from(r, s.hidden_from);
    s.asset = r.string("asset", s.asset);
    if (r.has("values")) s.values = read_object_values(r, s.values.get());
    if (r.has("causticCaster")) {
      const nlohmann::json& caster = r.raw("causticCaster");
      if (!caster.is_boolean() && caster != "auto") {
        r.fail("causticCaster", "\"auto\", true or false");
      }
      s.caustic_caster = !caster.is_boolean() ? CausticCaster::kAuto
                         : caster.get<bool>() ? CausticCaster::kYes
                                              : CausticCaster::kNo;
    }
    r.warn_unread(warnings);
  });
  // Unless one is named, what hangs together below one node of the scene is one asset.
  if (s.asset.empty()) s.asset = document.core.nodes[index].name;
  return s;
}

std::optional<DisplacementSettings> relief_displacement(const GltfDocument& document,
                                                        int material_index,
                                                        TextureTable& height_maps,
                                                        HeightGraphTable& height_graphs,
                                                        Warnings& warnings)
{
  std::optional<DisplacementSettings> out;
  const auto index = static_cast<std::size_t>(material_index);
  const auto& material = document.element("materials", index);
  const std::string path = "/materials/" + std::to_string(index);
  const bool own = document.read_extension(material, path, "RELIEF_displacement", [&](const JsonReader& r) {
    const std::string name = "material \"" + document.core.materials[index].name + '"';
    out = read_displacement(document, r, name, height_maps, height_graphs, warnings);
  });
  if (!own) {
    document.read_extension(material, path, "KHR_materials_displacement", [&](const JsonReader& r) {
      out = read_khr_displacement(document, r, height_maps, warnings);
    });
  }
  return out;
}

}  // namespace relief
