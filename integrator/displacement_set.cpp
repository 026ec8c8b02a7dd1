#include "integrator/displacement_set.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <iterator>
#include <numbers>
#include <stdexcept>
#include <string_view>
#include <tuple>

#include <unistd.h>

#include "integrator/stages.h"
#include "kernel/shape/surface_hit.h"
#include "scene/limits.h"

namespace relief {

namespace {

/// By how much a similarity scales: the cube root of its determinant, which can be below single precision. The root is
/// rounded to it, so that what turning leaves in the last digits of a double does not keep instances from sharing.
double similarity_scale(const Affine3& m)
{
  const double determinant = dot(to_double(m.x), cross(to_double(m.y), to_double(m.z)));
  return static_cast<double>(static_cast<float>(std::cbrt(std::abs(determinant))));
}

DisplacementMethod method_of(const DisplacementSettings& settings, const DisplacementOptions& options)
{
  return options.method.value_or(settings.method);
}

/// The most and the least that a transform stretches any direction.
struct Stretch {
  double most = 1, least = 1;
};

/// Largest singular value of a matrix of three columns: the root of MᵀM's largest eigenvalue.
/// @source Smith 1961, "Eigenvalues of a symmetric 3 × 3 matrix"
double largest_singular_value(Vec3d x, Vec3d y, Vec3d z)
{
  const double mean = (dot(x, x) + dot(y, y) + dot(z, z)) / 3;
  double a = dot(x, x) - mean, b = dot(y, y) - mean, c = dot(z, z) - mean;
  double xy = dot(x, y), yz = dot(y, z), zx = dot(z, x);
  const double radius = std::sqrt((a * a + b * b + c * c) / 6 + (xy * xy + yz * yz + zx * zx) / 3);
  if (!(radius > 0)) return std::sqrt(mean);
  for (double* entry : {&a, &b, &c, &xy, &yz, &zx}) *entry /= radius;
  const double determinant = a * (b * c - yz * yz) - xy * (xy * c - yz * zx) + zx * (xy * yz - b * zx);
  return std::sqrt(mean + 2 * radius * std::cos(std::acos(std::clamp(determinant / 2, -1.0, 1.0)) / 3));
}

/// The least by way of the adjugate, whose largest singular value is the product of M's two largest: beside MᵀM's largest
/// eigenvalue the others may be less than its rounding.
Stretch stretch_of(const Affine3& m)
{
  const Vec3d x = to_double(m.x), y = to_double(m.y), z = to_double(m.z);
  const double product = largest_singular_value(cross(y, z), cross(z, x), cross(x, y));
  return {largest_singular_value(x, y, z), product > 0 ? std::abs(dot(x, cross(y, z))) / product : 0};
}

float lod_of(const DisplacementSettings& settings, const DisplacementOptions& options)
{
  return options.lod.value_or(settings.lod);
}

bool is_whole(float x) { return x == std::floor(x); }

/// With fewer texels than this along a triangle's side a map has little left to show; levels beyond would only widen the
/// prisms.
constexpr double kLeastTexelsASide = 16;

/// Levels that rays may choose by themselves lose no more of the surface's slopes than this, metres a metre, nor move a
/// point further than this many of their texels: half a pixel, since texels are a quarter as wide as that. A picture's
/// mean then changes by at most about an eighth of the slope's square (docs/displacement.md), 1.4 %.
constexpr double kMostSlopeLost = 1.0 / 3;
constexpr double kMostTexelsLost = 2;

/// What `auto` means, and methods that this version lacks.
constexpr TraversalMethod kDefaultTraversal = TraversalMethod::kChord;

bool is_available(DisplacementMethod method)
{
  return traversal_method(method).has_value() || tessellation_kind(method).has_value();
}

std::string gibibytes(std::uint64_t bytes)
{
  char text[32];
  std::snprintf(text, sizeof text, "%.1f GiB", static_cast<double>(bytes) / (1 << 30));
  return text;
}

/// Embree leaves out what is beyond its limits without a word.
/// @param box  of an instance's displaced mesh, object space
void check_positions(const Scene& scene, const Instance& instance, const Box3& box)
{
  const Affine3& m = instance.world_from_object;
  const Vec3f extent = max(abs(box.low), abs(box.high));
  const Vec3f extent_world = abs(m.x) * extent.x + abs(m.y) * extent.y + abs(m.z) * extent.z + abs(m.p);
  // A mesh without triangles has a box of infinite extent, turned over.
  if (!(box.low.x <= box.high.x) || max_component(max(extent, extent_world)) <= kFarthestDisplaced) return;
  throw SceneError(scene.file, "", "displaced positions within 2e15 m of the origin",
                   "farther ones of node '" + instance.name + "'");
}

/// Refuses what would not fit, before anything large is allocated.
/// @param bytes  all tessellations so far, this one included
void check_budget(std::uint64_t bytes,
                  const TessellationLayout& layout,
                  const std::string& mesh,
                  const DisplacementOptions& options)
{
  const std::uint64_t half_of_memory =
      static_cast<std::uint64_t>(sysconf(_SC_PHYS_PAGES)) * static_cast<std::uint64_t>(sysconf(_SC_PAGESIZE)) / 2;
  const std::uint64_t budget = options.tessellation_bytes > 0 ? options.tessellation_bytes : half_of_memory;
  if (bytes <= budget) return;
  throw std::runtime_error(
      "tessellating mesh '" + mesh + "' into " + std::to_string(layout.num_micro_triangles / 1'000'000) +
      " million triangles would take about " + gibibytes(bytes) + ", more than the " + gibibytes(budget) +
      " that tessellations may have; the other displacement methods do not tessellate");
}

/// Half sides of the box that a point of a displaced surface is in, and the origin of a ray that leaves it along its normal.
/// @param P, Ng  object space
/// @return       object space
Vec3d leaving_reach(const InstanceView& placement, Vec3f P, Vec3f Ng)
{
  const DisplacedPointError error =
      displaced_point_error(placement, P, transform_point(placement.world_from_object, P));
  const Vec3f N = normalize(transform_normal(placement.object_from_world, as_normal(Ng)));
  const Vec3f offset = 2.0f * dot(abs(N), error.world) * N;
  // The origin has as large an error as the point.
  return to_double(2.0f * error.object + abs(transform_vector(placement.object_from_world, offset)));
}

std::string_view traversal_name(TraversalMethod method)
{
  const auto* found = std::find_if(kTraversalMethods.begin(), kTraversalMethods.end(),
                                   [=](const TraversalMethodLabel& label) { return label.method == method; });
  return found->name;
}

}  // namespace

std::optional<TraversalMethod> traversal_method(DisplacementMethod method)
{
  switch (method) {
    case DisplacementMethod::kAuto:
    case DisplacementMethod::kChord:
      return TraversalMethod::kChord;
    case DisplacementMethod::kRmip:
      return TraversalMethod::kRmip;
    case DisplacementMethod::kMinmaxRmip:
      return TraversalMethod::kRmipOnMinmax;
    case DisplacementMethod::kTfdm:
      return TraversalMethod::kTfdm;
    case DisplacementMethod::kTessellate:
    case DisplacementMethod::kGrid:
    case DisplacementMethod::kMicrotriangle:
    case DisplacementMethod::kCone:
      break;
  }
  return std::nullopt;
}

std::optional<TessellationKind> tessellation_kind(DisplacementMethod method)
{
  if (method == DisplacementMethod::kTessellate) return TessellationKind::kTriangles;
  if (method == DisplacementMethod::kGrid) return TessellationKind::kGrids;
  return std::nullopt;
}

std::vector<std::string> displacement_method_names()
{
  std::vector<std::string> names;
  for (std::size_t i = 0; i < std::size(kDisplacementMethodLabels); ++i) {
    if (is_available(static_cast<DisplacementMethod>(i))) names.emplace_back(kDisplacementMethodLabels[i]);
  }
  return names;
}

std::vector<std::string> displacement_warnings(const Scene& scene, const DisplacementOptions& options)
{
  std::vector<std::string> texts;
  for (std::size_t i = 0; i < scene.materials.size(); ++i) {
    const int index = scene.materials[i].displacement_index;
    if (index < 0) continue;
    const DisplacementSettings& settings = scene.displacements[static_cast<std::size_t>(index)];
    const std::string material = "material '" + scene.material_names[i] + "': ";
    if (const DisplacementMethod method = method_of(settings, options); !is_available(method)) {
      texts.push_back(material + "there is no displacement method '" +
                      std::string(kDisplacementMethodLabels[static_cast<std::size_t>(method)]) + "' yet; '" +
                      std::string(traversal_name(kDefaultTraversal)) + "' is used");
    }
    if (const float lod = lod_of(settings, options);
        tessellation_kind(method_of(settings, options)).has_value() && lod > 0 && !is_whole(lod)) {
      texts.push_back(material + "tessellations have whole levels of detail; level " +
                      std::to_string(static_cast<int>(lod)) + " is used");
    }
  }
  return texts;
}

DisplacementSet::Levels DisplacementSet::levels_of(const Scene& scene,
                                                   const Mesh& mesh,
                                                   const DisplacementSettings& settings,
                                                   const DisplacementOptions& options)
{
  constexpr float kCoarsest = kMaxLodLevels - 1;
  const float lod = lod_of(settings, options);
  const bool tessellates = tessellation_kind(method_of(settings, options)).has_value();
  Levels levels;
  if (lod >= 0) {
    levels.first = static_cast<int>(std::min(lod, kCoarsest));
    if (tessellates) return levels;
    levels.fixed = std::min(lod, kCoarsest) - static_cast<float>(levels.first);
    levels.count = levels.fixed > 0 ? 2 : 1;
  } else if (!tessellates) {
    const HeightMapView map = scene.height_maps[static_cast<std::size_t>(settings.height.texture_index)].view();
    double side = mean_texels_a_side(mesh.view(), settings.height, map.width, map.height);
    // Levels of the map end too: with one texel it is a constant.
    for (int texels = std::max(map.width, map.height); side >= 2 * kLeastTexelsASide && texels > 2; side /= 2) {
      texels = (texels + 1) / 2;
      ++levels.count;
    }
    levels.by_cone = levels.count > 1;
  }
  return levels;
}

DisplacementSet::DisplacementSet(const Scene& scene, const DisplacementOptions& options)
    : geometry_of_instance_(scene.instances.size(), -1), texel_of_instance_(scene.instances.size(), 0.0f)
{
  std::vector<Use> uses;
  std::map<std::tuple<int, int, double>, int> known;  // mesh, displacement, scale in object space
  for (std::size_t i = 0; i < scene.instances.size(); ++i) {
    const Instance& instance = scene.instances[i];
    const int displacement = scene.materials[static_cast<std::size_t>(instance.material_index)].displacement_index;
    if (displacement < 0) continue;
    const DisplacementSettings& settings = scene.displacements[static_cast<std::size_t>(displacement)];
    double scale = settings.scale;
    // The scene has only similarities there, see scene/world_displacement.h.
    if (settings.space == DisplacementSpace::kWorld) scale /= similarity_scale(instance.world_from_object);
    const auto [at, is_new] =
        known.try_emplace({instance.mesh_index, displacement, scale}, static_cast<int>(uses.size()));
    geometry_of_instance_[i] = at->second;
    if (is_new) uses.push_back({scene.meshes[static_cast<std::size_t>(instance.mesh_index)], settings, scale});
    const Stretch stretch = stretch_of(instance.world_from_object);
    double& steepening = uses[static_cast<std::size_t>(at->second)].steepening;
    steepening = std::max(steepening, stretch.most / stretch.least);
  }
  const auto num_displaced =
      std::count_if(geometry_of_instance_.begin(), geometry_of_instance_.end(), [](int index) { return index >= 0; });
  const double num_rays = options.num_rays / static_cast<double>(num_displaced);
  std::uint64_t tessellated_bytes = 0;
  for (const Use& use : uses) {
    geometries_.push_back(make_displaced(scene, use, options));
    Displaced& displaced = *geometries_.back();
    displaced.tessellation = tessellate(displaced.geometry, displaced.name, method_of(use.settings, options), options,
                                        num_rays, &tessellated_bytes);
  }
  for (std::size_t i = 0; i < scene.instances.size(); ++i) {
    if (geometry_of_instance_[i] < 0) continue;
    check_positions(scene, scene.instances[i], displaced(i).mesh.bounds());
    texel_of_instance_[i] =
        displaced(i).geometry.lod.texel * static_cast<float>(stretch_of(scene.instances[i].world_from_object).most);
  }
}

std::unique_ptr<DisplacementSet::Displaced> DisplacementSet::make_displaced(const Scene& scene,
                                                                            const Use& use,
                                                                            const DisplacementOptions& options)
{
  const DisplacementSettings& settings = use.settings;
  auto displaced = std::make_unique<Displaced>();
  displaced->name = use.mesh.name;
  displaced->smooth = settings.smoothing;
  DisplacedGeometry& geometry = displaced->geometry;
  geometry.method = traversal_method(method_of(settings, options)).value_or(kDefaultTraversal);
  Levels levels = levels_of(scene, use.mesh, settings, options);
  std::vector<const HeightFieldView*> coarser;
  if (levels.by_cone) {
    levels.count = num_faithful_levels(scene, use, levels.count);
    levels.by_cone = levels.count > 1;
  }
  for (int k = 0; k < levels.count; ++k) {
    geometry.levels[k] = level(scene, settings.height.texture_index, levels.first + k, geometry.method);
    if (k > 0) coarser.push_back(geometry.levels[k].field);
  }
  displaced->mesh = DisplacedMesh(use.mesh.view(), *geometry.levels[0].field,
                                  {settings.height, use.scale, settings.midlevel, settings.weld_seams}, coarser);
  geometry.mesh = displaced->mesh.view();
  geometry.lod = {levels.count, levels.by_cone, levels.fixed, displaced->mesh.widest_texel()};
  has_levels_ |= levels.count > 1;
  return displaced;
}

std::unique_ptr<Tessellation> DisplacementSet::tessellate(const DisplacedGeometry& geometry,
                                                          const std::string& mesh,
                                                          DisplacementMethod method,
                                                          const DisplacementOptions& options,
                                                          double num_rays,
                                                          std::uint64_t* used_bytes)
{
  const auto layout_of = [&](TessellationKind kind) {
    return tessellation_layout_make(geometry.mesh, kind, options.tessellation_rate);
  };
  if (const std::optional<TessellationKind> kind = tessellation_kind(method)) {
    TessellationLayout layout = layout_of(*kind);
    *used_bytes += tessellation_peak_bytes(layout, kRenderTessellation);
    check_budget(*used_bytes, layout, mesh, options);
    return std::make_unique<Tessellation>(geometry.mesh, std::move(layout));
  }
  // Layouts cost time and memory of their own, so nothing is made of them without an allowance.
  if (method != DisplacementMethod::kAuto || options.auto_bytes <= *used_bytes || geometry.lod.fixed > 0)
    return nullptr;
  TessellationLayout triangles = layout_of(TessellationKind::kTriangles), grids = layout_of(TessellationKind::kGrids);
  const DisplacementChoice choice =
      displacement_choose(kDisplacementCosts, triangles, grids, num_rays, options.auto_bytes - *used_bytes);
  reasons_.push_back("mesh '" + mesh + "': " + choice.reason);
  if (!choice.tessellates) return nullptr;
  TessellationLayout& chosen = choice.kind == TessellationKind::kTriangles ? triangles : grids;
  *used_bytes += tessellation_peak_bytes(chosen, kRenderTessellation);
  return std::make_unique<Tessellation>(geometry.mesh, std::move(chosen));
}

int DisplacementSet::num_faithful_levels(const Scene& scene, const Use& use, int most)
{
  const TextureRef& mapping = use.settings.height;
  const double scale = std::abs(use.scale);
  const MapDensity density = map_density(use.mesh.view(), mapping);
  const HeightMapView map = scene.height_maps[static_cast<std::size_t>(mapping.texture_index)].view();
  const double texel = 1 / std::sqrt(std::max(density.u * map.width * density.v * map.height, 1e-300));
  LevelLoss lost;
  for (int k = 1; k < most; ++k) {
    const bool is_new = !fields_.contains({mapping.texture_index, k});
    const HeightMapView fine = k > 1 ? field(scene, mapping.texture_index, k - 1).level.view() : map;
    Field& coarse = field(scene, mapping.texture_index, k);
    if (!coarse.loss) coarse.loss = level_loss(fine, coarse.level.view());
    lost = lost + *coarse.loss;
    const double slope = use.steepening * scale * (lost.slope_u * density.u + lost.slope_v * density.v);
    const double texels = scale * lost.height / (texel * (1 << k));
    if (slope <= kMostSlopeLost && texels <= kMostTexelsLost) continue;
    if (is_new) fields_.erase({mapping.texture_index, k});
    return k;
  }
  return most;
}

DisplacementSet::Field& DisplacementSet::field(const Scene& scene, int map_index, int level)
{
  const auto [at, is_new] = fields_.try_emplace({map_index, level});
  Field& field = at->second;
  if (is_new) {
    HeightMapView map = scene.height_maps[static_cast<std::size_t>(map_index)].view();
    if (level > 0) {
      field.level = HeightLevel(map, level);
      map = field.level.view();
    }
    field.bounds = HeightField(map);
  }
  return field;
}

DisplacementLevel DisplacementSet::level(const Scene& scene, int map_index, int level, TraversalMethod method)
{
  Field& f = field(scene, map_index, level);
  DisplacementLevel out{&f.bounds.view(), nullptr, nullptr};
  switch (method) {
    case TraversalMethod::kChord:
      break;
    case TraversalMethod::kRmip:
      if (f.rmip == nullptr) f.rmip = std::make_unique<Rmip>(f.bounds.view());
      out.rmip = &f.rmip->view();
      break;
    case TraversalMethod::kRmipOnMinmax:
    case TraversalMethod::kTfdm:
      if (f.mipmap == nullptr) f.mipmap = std::make_unique<MinmaxMipmap>(f.bounds.view());
      out.mipmap = &f.mipmap->view();
      break;
  }
  return out;
}

DisplacedPoint DisplacementSet::point(std::size_t instance,
                                      const InstanceView& placement,
                                      std::uint32_t primitive,
                                      float u,
                                      float v,
                                      float Ng_x) const
{
  const Displaced& d = displaced(instance);
  DisplacedPoint out{primitive, u, v};
  int level = 0;
  bool on_wall = false;
  if (d.tessellation != nullptr) {
    const MicroHit hit = d.tessellation->hit(primitive, u, v);
    out.triangle = hit.triangle;
    out.u = static_cast<float>(hit.b1);
    out.v = static_cast<float>(hit.b2);
    out.P = to_float(hit.P);
    out.Ng = to_float(hit.Ng);
  } else {
    const ReportedPoint reported = displaced_point(d.geometry, primitive, {u, v, Ng_x});
    level = reported.level;
    on_wall = reported.on_wall;
    out.u = reported.b1;
    out.v = reported.b2;
    out.P = to_float(reported.point.P);
    out.Ng = to_float(reported.point.Ng);
    if (!on_wall) {
      out.leave = to_float(
          displaced_leave(d.geometry, primitive, level, out.u, out.v, leaving_reach(placement, out.P, out.Ng)));
    }
    if (d.geometry.lod.by_cone) out.width = lod_width_of_level(texel_of_instance_[instance], level);
  }
  out.Ns =
      d.smooth && !on_wall ? to_float(displaced_smooth_normal(d.geometry, out.triangle, level, out.u, out.v)) : out.Ng;
  return out;
}

DisplacedPoint DisplacementSet::locate(std::size_t instance, std::uint32_t primitive, float u, float v) const
{
  const Displaced& d = displaced(instance);
  if (d.tessellation == nullptr) return {primitive, u, v};
  const MicroHit hit = d.tessellation->locate(primitive, u, v);
  return {hit.triangle, static_cast<float>(hit.b1), static_cast<float>(hit.b2)};
}

std::size_t DisplacementSet::bytes() const
{
  std::size_t sum = 0;
  for (const auto& [key, field] : fields_) {
    sum += field.level.bytes() + field.bounds.bytes();
    if (field.rmip != nullptr) sum += field.rmip->bytes();
    if (field.mipmap != nullptr) sum += field.mipmap->bytes();
  }
  for (const auto& displaced : geometries_) {
    sum += displaced->mesh.bytes();
    if (displaced->tessellation != nullptr) sum += displaced->tessellation->bytes();
  }
  return sum;
}

std::uint64_t DisplacementSet::num_triangles() const
{
  std::uint64_t sum = 0;
  for (const auto& displaced : geometries_) sum += displaced->geometry.mesh.num_triangles;
  return sum;
}

DisplacedMeshReport DisplacementSet::report() const
{
  DisplacedMeshReport sum;
  for (const auto& displaced : geometries_) {
    const DisplacedMeshReport& report = displaced->mesh.report();
    sum.num_folded += report.num_folded;
    sum.num_short_normals += report.num_short_normals;
    sum.num_degenerate += report.num_degenerate;
    sum.num_walls += report.num_walls;
    sum.num_far_uv += report.num_far_uv;
  }
  return sum;
}

std::string DisplacementSet::method_names() const
{
  std::string names;
  for (const TraversalMethodLabel& label : kTraversalMethods) {
    const auto uses = [&](const auto& displaced) {
      return displaced->tessellation == nullptr && displaced->geometry.method == label.method;
    };
    if (std::none_of(geometries_.begin(), geometries_.end(), uses)) continue;
    names += (names.empty() ? "" : ", ") + std::string(label.name);
  }
  for (const DisplacementMethod method : {DisplacementMethod::kTessellate, DisplacementMethod::kGrid}) {
    const auto uses = [&](const auto& displaced) {
      return displaced->tessellation != nullptr && displaced->tessellation->layout().kind == tessellation_kind(method);
    };
    if (std::none_of(geometries_.begin(), geometries_.end(), uses)) continue;
    names += (names.empty() ? "" : ", ") + std::string(kDisplacementMethodLabels[static_cast<std::size_t>(method)]);
  }
  return names;
}

std::vector<std::string> DisplacementSet::warnings() const
{
  std::vector<std::string> texts;
  for (const auto& displaced : geometries_) {
    const DisplacedMeshReport& report = displaced->mesh.report();
    const std::string of = " of " + std::to_string(displaced->geometry.mesh.num_triangles) + " triangles of mesh '" +
                           displaced->name + "' ";
    if (report.num_degenerate > 0) {
      texts.push_back(std::to_string(report.num_degenerate) + of +
                      "have no normal to be displaced along and are left out");
    }
    if (report.num_far_uv > 0) {
      const HeightMapView& map = displaced->geometry.mesh.field->map;
      char limit[32];
      std::snprintf(limit, sizeof limit, "%.2g", kMostTexels / std::max(map.width, map.height));
      texts.push_back(
          std::to_string(report.num_far_uv) + of + "(the first is triangle " + std::to_string(report.first_far_uv) +
          ") have texture coordinates beyond " + limit +
          ", where the texels of their height map cannot be told apart; they are displaced as at uv (0, 0)");
    }
    if (report.num_short_normals > 0) {
      texts.push_back(std::to_string(report.num_short_normals) + of +
                      "have normals that cancel inside; around that point their displaced surface is left out");
    }
  }
  return texts;
}

const TraversalTable& traversal_table_select()
{
  return std::string_view(stage_table_select().isa) == "avx2" ? traversal_table_avx2() : traversal_table_baseline();
}

}  // namespace relief
