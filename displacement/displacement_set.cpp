#include "displacement/displacement_set.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <stdexcept>
#include <tuple>
#include <utility>

#include <unistd.h>

#include "displacement/cost_model.h"
#include "displacement/stretch.h"

namespace relief {

namespace {

/// By how much a similarity scales: the cube root of its determinant, which can be below single precision. The root is
/// rounded to it, so that what turning leaves in the last digits of a double does not keep instances from sharing.
double similarity_scale(const Affine3& m)
{
  const double determinant = dot(to_double(m.x), cross(to_double(m.y), to_double(m.z)));
  return static_cast<double>(static_cast<float>(std::cbrt(std::abs(determinant))));
}

DisplacementMethod asked_method(const DisplacementSettings& settings, const DisplacementOptions& options)
{
  return options.method.value_or(settings.method);
}

float lod_of(const DisplacementSettings& settings, const DisplacementOptions& options)
{
  return options.lod.value_or(settings.lod);
}

bool is_whole(float x) { return x == std::floor(x); }

/// With fewer texels than this along a triangle's side a map has little left to show; levels beyond would only widen the
/// prisms.
constexpr double kLeastTexelsASide = 16;

/// Of meshes diced to a pixel, facets included: benchmarks/cycles' sphere and torus took .34 of what they take by chord. Of a
/// texture's every texel, tessellations are larger than caches, and cost more (methods/tessellate.cpp).
constexpr MethodCost kDicingCost{208, 29, 350};

/// Levels that rays may choose by themselves lose no more of the surface's slopes than this, metres a metre, nor move a
/// point further than this many of their texels: half a pixel, since texels are a quarter as wide as that. A picture's
/// mean then changes by a fortieth of the slope's square at most (docs/displacement.md), .3 %.
constexpr double kMostSlopeLost = 1.0 / 3;
constexpr double kMostTexelsLost = 2;

/// Computed heights over triangles of so many cells along a side, in the mean, are those of their vertices, as in Cycles: whoever
/// divided a mesh so finely did it for these, and tracing what is between takes 4 to 40 times as long (noise on 640 × 640 quads at
/// 320 × 180 pixels 294 processor seconds instead of 7, cracks on 200 × 200 at 1280 × 720, of six cells, 78 instead of 9).
constexpr double kMostMovedCells = 16;

/// Sides of divided triangles, cells at most: lattices have powers of two, so they are one to two cells long. Of one cell and less
/// there would be four times as many.
constexpr double kDividedCells = 2;

/// A mesh of fewer triangles was not divided to be displaced: however small it is now, the camera may come near.
constexpr std::uint32_t kLeastMovedTriangles = 64;

/// Whether a mesh's own vertices are moved.
/// @param cells  along a side of its triangles in the mean
bool is_dense(const DisplacementSettings& settings, const MeshView& mesh, double cells)
{
  return !settings.divide && mesh.num_triangles >= kLeastMovedTriangles && cells <= kMostMovedCells;
}

bool has_one_height(const HeightMapView& map)
{
  const std::int64_t count = std::int64_t{map.width} * map.height;
  std::int64_t same = 1;
  while (same < count && height_at(map, same) == height_at(map, 0)) ++same;
  return same == count;
}

std::string gibibytes(std::uint64_t bytes)
{
  char text[32];
  std::snprintf(text, sizeof text, "%.1f GiB", static_cast<double>(bytes) / (1 << 30));
  return text;
}

std::uint64_t memory_of_machine()
{
  return static_cast<std::uint64_t>(sysconf(_SC_PHYS_PAGES)) * static_cast<std::uint64_t>(sysconf(_SC_PAGESIZE));
}

/// What meshes that are diced or divided may take, all together.
std::uint64_t dicing_allowance(const DisplacementOptions& options)
{
  return options.auto_bytes > 0     ? options.auto_bytes
         : options.dicing_bytes > 0 ? options.dicing_bytes
                                    : memory_of_machine() / 8;
}

/// Refuses what would not fit, before anything large is allocated.
/// @param bytes  all tessellations so far, this one included
void check_budget(std::uint64_t bytes,
                  const TessellationLayout& layout,
                  const std::string& mesh,
                  const DisplacementOptions& options)
{
  const std::uint64_t budget = options.tessellation_bytes > 0 ? options.tessellation_bytes : memory_of_machine() / 2;
  if (bytes <= budget) return;
  throw std::runtime_error(
      "tessellating mesh '" + mesh + "' into " + std::to_string(layout.num_micro_triangles / 1'000'000) +
      " million triangles would take about " + gibibytes(bytes) + ", more than the " + gibibytes(budget) +
      " that tessellations may have; the other displacement methods do not tessellate");
}

std::optional<TessellationKind> tessellation_kind(DisplacementMethod method)
{
  return method == DisplacementMethod::kAuto ? std::nullopt : displacement_method(method).tessellation;
}

RmipOptionsUse rmip_options_use(DisplacementMethod method)
{
  return method != DisplacementMethod::kAuto ? displacement_method(method).rmip_options : RmipOptionsUse::kNone;
}

/// Whether a surface between two levels is traced instead of either by chance. A level that rays choose by their cones would
/// change along them: a surface that is bilinear nowhere.
bool blends_levels(const DisplacementSettings& settings, const DisplacementOptions& options)
{
  const float lod = lod_of(settings, options);
  return rmip_options_use(asked_method(settings, options)) == RmipOptionsUse::kAll && options.rmip &&
         options.rmip->levels == RmipLevels::kInterpolated && lod > 0 && !is_whole(lod);
}

/// For a mesh that is tessellated: such are not kept.
void forget_tree(PreparedMesh& mesh)
{
  mesh.content.reset();
  mesh.tree.reset();
  mesh.geometry.scene = nullptr;
}

/// What DisplacedMesh and its tree are made of. Fields are known by their places: what is kept goes with the first set that
/// does not ask for it, and so no later than the fields it was made of.
ContentHash prisms_content(const MeshView& mesh,
                           const DisplacementMapping& mapping,
                           const std::vector<const HeightFieldView*>& fields)
{
  ContentHasher hash;
  hash.add_array(mesh.P, mesh.num_vertices);
  hash.add_array(mesh.N, mesh.num_vertices);
  hash.add_array(mesh.uv[mapping.height.uv_set], mesh.num_vertices);
  hash.add_array(mesh.triangles, mesh.num_triangles);
  const TextureRef& m = mapping.height;
  hash.add(m.m00, m.m01, m.m02, m.m10, m.m11, m.m12, mapping.scale, mapping.midlevel, mapping.weld_seams);
  hash.add_array(fields.data(), fields.size());
  return hash.result();
}

/// Brings a point's place from a part of a triangle to the triangle.
void set_base_place(const ProceduralField& field, DisplacedPoint* point)
{
  const LatticeTriangle& part = field.triangles()[point->triangle];
  const Vec2f place = part.base_weights(point->u, point->v);
  point->triangle = part.base;
  point->u = place.x;
  point->v = place.y;
}

}  // namespace

std::vector<std::string> displacement_warnings(const DisplacementSettings& settings, const DisplacementOptions& options)
{
  std::vector<std::string> texts;
  const float lod = lod_of(settings, options);
  const DisplacementMethod asked = asked_method(settings, options);
  if (displacement_is_computed(settings)) {
    const std::string of_maps = settings.by_vectors ? " has no effect on displacement by vectors"
                                                    : " has no effect on heights that are computed";
    if (asked != DisplacementMethod::kAuto && asked != kDefaultMethod)
      texts.push_back("displacement method '" + std::string(displacement_method_label(asked)) + "'" + of_maps);
    if (lod > 0) texts.push_back("a level of detail" + of_maps);
    return texts;
  }
  if (tessellation_kind(asked) && lod > 0 && !is_whole(lod)) {
    texts.push_back("tessellations have whole levels of detail; level " + std::to_string(static_cast<int>(lod)) +
                    " is used");
  }
  const RmipOptionsUse use = rmip_options_use(asked);
  const std::string_view without_effect = use == RmipOptionsUse::kNone ? "options" : "options but 'bounds'";
  const bool is_obeyed = use == RmipOptionsUse::kAll || (use == RmipOptionsUse::kBounds && options.rmip &&
                                                         *options.rmip == RmipOptions{.bounds = options.rmip->bounds});
  if (options.rmip && !is_obeyed) {
    texts.push_back(std::string(without_effect) + " of RMIP have no effect on displacement method '" +
                    std::string(displacement_method_label(asked)) + "'");
  } else if (options.rmip && options.rmip->levels == RmipLevels::kInterpolated && !blends_levels(settings, options)) {
    texts.push_back(std::string("RMIP interpolates only between levels of detail that are fixed, such as 1.5; ") +
                    (lod < 0 ? "those that rays choose by their cones are mixed" : "a whole level is traced as it is"));
  }
  return texts;
}

DisplacementMethod DisplacementSet::method_of(const Use& use, const DisplacementOptions& options) const
{
  const DisplacementMethod asked = asked_method(use.settings, options);
  return !use.steps.empty() && tessellation_kind(asked) ? kDefaultMethod : asked;
}

/// Says what is not done with a mesh that deforms.
void DisplacementSet::leave_untessellated(const Use& use, const DisplacementOptions& options)
{
  const DisplacementMethod asked = asked_method(use.settings, options);
  if (has_error(use, options)) {
    reasons_.push_back("mesh '" + use.mesh_name + "': not diced, as it deforms while the shutter is open");
  } else if (tessellation_kind(asked)) {
    unfollowed_.push_back("mesh '" + use.mesh_name + "' deforms while the shutter is open, and is traced by method '" +
                          std::string(displacement_method_label(kDefaultMethod)) + "': tessellations are of one time");
  }
}

bool DisplacementSet::has_error(const Use& use, const DisplacementOptions& options) const
{
  return options.error > 0 && options.camera && use.heights == nullptr && !(lod_of(use.settings, options) > 0) &&
         method_of(use, options) == DisplacementMethod::kAuto;
}

void DisplacementSet::set_facets(const Use& use, DisplacedGeometry* geometry, bool diced) const
{
  const int last = geometry->first_level + geometry->lod.num_levels - 1;
  if (last == 0) return;
  MapFacets& facets = geometry->facets.emplace(MapFacets{height_lattice_make(map_of(use).view)});
  const bool tessellated = displacement_method(geometry->method).tessellation.has_value();
  const double spacing = diced ? Dicing::kTexelsASide : tessellated ? 1.0 : 0.0;
  facets.window = diced ? 1.0 / Dicing::kTexelsASide : 1.0;
  for (int level = std::max(geometry->first_level, 1); level <= last; ++level) {
    // What is diced to a level has the heights of the one before.
    static_assert(Dicing::kTexelsASide == 2);
    const HeightFieldView& heights = *geometry->levels[level - geometry->first_level - (diced ? 1 : 0)].field;
    facets.spread[level] =
        facet_spread(facets.texels, heights, spacing, facets.window * (1 << level), geometry->smooth);
  }
}

int DisplacementSet::num_useful_levels(const Use& use) const
{
  const HeightMapView& map = map_of(use).view;
  double side = mean_texels_a_side(use.mesh, use.settings.height, map.width, map.height);
  int count = 1;
  // Levels of the map end too: with one texel it is a constant.
  for (int texels = std::max(map.width, map.height); side >= 2 * kLeastTexelsASide && texels > 2; side /= 2) {
    texels = (texels + 1) / 2;
    ++count;
  }
  return count;
}

DisplacementSet::Levels DisplacementSet::levels_of(const Use& use, const DisplacementOptions& options) const
{
  constexpr float kCoarsest = kMaxLodLevels - 1;
  const float lod = lod_of(use.settings, options);
  const bool tessellates = tessellation_kind(method_of(use, options)).has_value();
  Levels levels;
  if (lod >= 0) {
    levels.first = static_cast<int>(std::min(lod, kCoarsest));
    if (tessellates) return levels;
    const bool is_one_surface = !use.has_borders || blends_levels(use.settings, options);
    levels.fixed = is_one_surface ? std::min(lod, kCoarsest) - static_cast<float>(levels.first) : 0.0f;
    levels.count = levels.fixed > 0 ? 2 : 1;
  } else if (!tessellates) {
    levels.count = use.has_borders ? 1 : num_useful_levels(use);
    levels.by_cone = levels.count > 1;
  }
  return levels;
}

std::vector<DisplacementSet::Use> DisplacementSet::find_uses(const DisplacementInput& input)
{
  std::vector<Use> uses;
  std::map<std::tuple<int, int, int, double>, int> known;  // mesh, displacement, heights, scale in object space
  std::vector<bool> has_borders(input.instances.size(), false);
  for (const DisplacedBorder& border : input.borders) {
    for (const std::size_t side : border.sides) has_borders[side] = true;
  }
  for (std::size_t i = 0; i < input.instances.size(); ++i) {
    const DisplacedInstance& instance = input.instances[i];
    if (instance.displacement_index < 0) continue;
    const DisplacementSettings& settings = input.settings[static_cast<std::size_t>(instance.displacement_index)];
    double scale = settings.scale;
    // There are only similarities there, see scene/world_displacement.h.
    if (settings.space == DisplacementSpace::kWorld) scale /= similarity_scale(instance.world_from_object);
    const auto mesh = static_cast<std::size_t>(instance.mesh_index);
    const auto [at, is_new] =
        known.try_emplace({instance.mesh_index, instance.displacement_index, instance.heights_index, scale},
                          static_cast<int>(uses.size()));
    geometry_of_instance_[i] = at->second;
    if (is_new) {
      const int heights = instance.heights_index;
      uses.push_back({meshes_[mesh], instance.mesh_index, input.mesh_names[mesh], instance.displacement_index, settings,
                      heights < 0 ? nullptr : &input.heights[static_cast<std::size_t>(heights)],
                      mesh < input.mesh_steps.size() ? std::span<const MeshShape>(input.mesh_steps[mesh])
                                                     : std::span<const MeshShape>{},
                      scale});
    }
    const Stretch stretch = stretch_of(instance.world_from_object);
    Use& use = uses[static_cast<std::size_t>(at->second)];
    use.places.push_back(instance.world_from_object);
    use.has_borders = use.has_borders || has_borders[i];
    use.steepening = std::max(use.steepening, stretch.most / stretch.least);
  }
  return uses;
}

/// @pre  there is a camera
PictureView DisplacementSet::picture_view(const Use& use, const DisplacementOptions& options)
{
  return {*options.camera, static_cast<double>(options.picture_height),
          static_cast<double>(use.settings.coarser_outside)};
}

/// About which part of a picture's rays meet a use: how much of the picture the boxes of its instances fill, together at
/// most all of it; 1 without a camera.
double DisplacementSet::picture_share(const Use& use, const DisplacementOptions& options)
{
  if (!options.camera || options.picture_height <= 0) return 1;
  const PictureView view = picture_view(use, options);
  const double height = view.height;
  const double width =
      height * static_cast<double>(options.camera->half_width) / static_cast<double>(options.camera->half_height);
  Box3 box = box_empty();
  for (std::uint32_t i = 0; i < use.mesh.num_vertices; ++i) box = box_union(box, {use.mesh.P[i], use.mesh.P[i]});
  double share = 0;
  for (const Affine3& place : use.places) {
    const Vec3f low = transform_point(place, box.low), high = transform_point(place, box.high);
    const double pixels = view.pixels(low, high) / view.coarsening(0.5 * (to_double(low) + to_double(high)));
    share += std::min(pixels * pixels / (width * height), 1.0);
  }
  return std::min(share, 1.0);
}

DisplacementSet::DisplacementSet(const DisplacementInput& input, const DisplacementOptions& options)
    : height_maps_(input.height_maps),
      meshes_(input.meshes),
      heights_owner_(input.heights_owner),
      geometry_of_instance_(input.instances.size(), -1),
      moved_of_instance_(input.instances.size(), -1),
      texel_of_instance_(input.instances.size(), 0.0f),
      fields_(options.fields != nullptr ? options.fields : std::make_shared<HeightFields>()),
      kept_meshes_(options.meshes)
{
  const std::vector<Use> uses = find_uses(input);
  std::uint64_t tessellated_bytes = 0;
  std::vector<std::pair<int, int>> places;  // of each use: its geometry or its moved mesh
  PartsOfMoved parts_of_moved;
  for (const Use& use : uses) {
    std::vector<LatticeTriangle> parts;
    if (const VertexMove move = vertex_move_of(use, options, &parts, &tessellated_bytes); move != VertexMove::kNone) {
      places.emplace_back(-1, static_cast<int>(moved_.size()));
      moved_.push_back(make_moved(use, move, parts));
      parts_of_moved.emplace_back();
      if (use.has_borders) parts_of_moved.back() = std::move(parts);
      continue;
    }
    places.emplace_back(static_cast<int>(geometries_.size()), -1);
    if (use.heights != nullptr) {
      geometries_.push_back(use.settings.by_vectors ? make_tiled(use, std::move(parts)) : make_computed(use, options));
      continue;
    }
    geometries_.push_back(make_displaced(use, options));
    const double num_rays = options.num_rays * picture_share(use, options);
    if (!use.steps.empty()) {
      leave_untessellated(use, options);
    } else if (has_error(use, options)) {
      dice(*geometries_.back(), use, options, num_rays, &tessellated_bytes);
    } else {
      tessellate(*geometries_.back(), options, method_of(use, options) == DisplacementMethod::kAuto, num_rays,
                 &tessellated_bytes);
    }
  }
  for (std::size_t i = 0; i < input.instances.size(); ++i) {
    if (geometry_of_instance_[i] < 0) continue;
    std::tie(geometry_of_instance_[i], moved_of_instance_[i]) =
        places[static_cast<std::size_t>(geometry_of_instance_[i])];
    if (geometry_of_instance_[i] < 0) continue;
    texel_of_instance_[i] =
        displaced(i).geometry.lod.texel * static_cast<float>(stretch_of(input.instances[i].world_from_object).most);
  }
  make_borders(input, parts_of_moved);
  kept_ = fields_->end_set();
  if (kept_meshes_ != nullptr) kept_tally_ = kept_meshes_->end_set();
}

DisplacementSet::~DisplacementSet()
{
  if (kept_meshes_ == nullptr) return;
  for (std::unique_ptr<PreparedMesh>& geometry : geometries_) {
    if (geometry->content && geometry->tree != nullptr) kept_meshes_->put(std::move(geometry));
  }
}

void DisplacementSet::set_tree(std::size_t index, std::shared_ptr<RTCSceneTy> tree, std::uint64_t bytes, double seconds)
{
  PreparedMesh& prepared = *geometries_[index];
  prepared.tree = std::move(tree);
  prepared.tree_bytes = bytes;
  prepared.seconds += seconds;
}

std::unique_ptr<PreparedMesh> DisplacementSet::make_displaced(const Use& use, const DisplacementOptions& options)
{
  const DisplacementSettings& settings = use.settings;
  const DisplacementMethod asked = method_of(use, options);
  DisplacedGeometry geometry;
  geometry.method = asked == DisplacementMethod::kAuto ? kDefaultMethod : asked;
  geometry.smooth = settings.smoothing;
  geometry.rmip_options = options.rmip.value_or(RmipOptions{});
  Levels levels = levels_of(use, options);
  if (levels.by_cone) {
    levels.count = num_faithful_levels(use, levels.count);
    levels.by_cone = levels.count > 1;
  }
  std::vector<const HeightFieldView*> fields;
  for (int k = 0; k < levels.count; ++k) {
    geometry.levels[k] =
        fields_->level(map_of(use), levels.first + k, displacement_method(geometry.method), geometry.rmip_options);
    fields.push_back(geometry.levels[k].field);
  }
  geometry.first_level = levels.first;
  geometry.lod.num_levels = levels.count;
  set_facets(use, &geometry, false);
  const DisplacementMapping mapping{settings.height, use.scale, settings.midlevel, settings.weld_seams};
  std::unique_ptr<PreparedMesh> displaced = prisms_of(use, mapping, fields);
  displaced->name = use.mesh_name;
  displaced->displacement_index = use.displacement_index;
  displaced->mesh_index = use.mesh_index;
  displaced->walls = {};
  displaced->method = geometry.method;
  geometry.mesh = displaced->mesh.view();
  geometry.lod = {levels.count, levels.by_cone, levels.fixed, displaced->mesh.widest_texel()};
  geometry.scene = displaced->tree.get();
  if (levels.count > 1 && blends_levels(settings, options)) {
    displaced->blend = {geometry.levels[1].field, geometry.levels[1].table, static_cast<double>(levels.fixed)};
    geometry.mesh.blend = &displaced->blend;
    geometry.lod.num_levels = 1;
    geometry.lod.fixed = 0;
  }
  displaced->geometry = geometry;
  has_levels_ |= geometry.lod.num_levels > 1;
  has_facets_ |= geometry.facets.has_value();
  return displaced;
}

std::unique_ptr<PreparedMesh> DisplacementSet::prisms_of(const Use& use,
                                                         const DisplacementMapping& mapping,
                                                         const std::vector<const HeightFieldView*>& fields)
{
  std::optional<ContentHash> content;
  // What deforms is another in the next frame.
  if (kept_meshes_ != nullptr && use.steps.empty()) {
    content = prisms_content(use.mesh, mapping, fields);
    if (std::unique_ptr<PreparedMesh> kept = kept_meshes_->take(*content)) return kept;
  }
  const auto start = std::chrono::steady_clock::now();
  auto displaced = std::make_unique<PreparedMesh>();
  displaced->mesh = DisplacedMesh(use.mesh, *fields.front(), mapping, std::span(fields).subspan(1), use.steps);
  displaced->content = content;
  displaced->seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return displaced;
}

VertexMove DisplacementSet::vertex_move_of(const Use& use,
                                           const DisplacementOptions& options,
                                           std::vector<LatticeTriangle>* parts,
                                           std::uint64_t* used_bytes)
{
  if (use.settings.by_vectors) return vector_move_of(use, options, parts, used_bytes);
  if (use.mesh.N == nullptr || use.mesh.num_triangles == 0 || !use.steps.empty() || use.settings.curved ||
      asked_method(use.settings, options) != DisplacementMethod::kAuto) {
    return VertexMove::kNone;
  }
  const std::string of = "mesh '" + use.mesh_name + "': ";
  const auto is_constant = [&] {
    if (use.heights != nullptr) return use.heights->is_constant;
    if (lod_of(use.settings, options) > 0) return false;
    return has_one_height(map_of(use).view);
  };
  if (is_constant()) {
    reasons_.push_back(of + "its vertices are moved, as its heights are all the same");
    return VertexMove::kOwn;
  }
  if (use.heights == nullptr || use.heights->num_cells > 0) return VertexMove::kNone;
  const double cells = mean_cells_a_side(use.mesh, use.heights->cells);
  VertexMove move = is_dense(use.settings, use.mesh, cells) ? VertexMove::kOwn : VertexMove::kDivided;
  VertexMove* before = nullptr;
  std::uint64_t allowance = dicing_allowance(options);
  if (options.choices != nullptr) {
    const auto [known, is_new] = options.choices->moved.try_emplace(
        {use.mesh_name, use.displacement_index, use.mesh.num_triangles, use.scale, 0, 0, options.picture_height, 0},
        move);
    before = &known->second;
    move = *before;
    // In the first picture with room for what the others may take more.
    if (is_new) allowance /= 2;
  }
  char text[96];
  if (move == VertexMove::kDivided) {
    const CellsAlong& seen = use.heights->cells_seen;
    *parts = lattices_make(
        use.mesh, [&](Vec3f a, Vec3f b) { return seen(a, b) / kDividedCells; }, options.require,
        use.settings.most_cells);
    const std::uint64_t bytes = divided_mesh_bytes(use.mesh, *parts);
    if (bytes > allowance - std::min(allowance, *used_bytes)) {
      parts->clear();
      move = VertexMove::kNone;
      reasons_.push_back(of + "rays are traced over its heights, as dividing it would take " + gibibytes(bytes));
    } else {
      *used_bytes += bytes;
      std::snprintf(text, sizeof text, "it is divided to the picture, which takes %s", gibibytes(bytes).c_str());
      reasons_.push_back(of + text);
    }
  } else if (move == VertexMove::kOwn) {
    std::snprintf(text, sizeof text, "its vertices are moved, as its triangles are %.2g cells wide in the mean", cells);
    reasons_.push_back(of + text);
  }
  if (before != nullptr) *before = move;
  return move;
}

bool DisplacementSet::fits_in_tiles(const Use& use,
                                    const DisplacementOptions& options,
                                    std::span<const LatticeTriangle> parts,
                                    std::uint64_t allowance,
                                    std::uint64_t* used_bytes)
{
  if (!use.steps.empty()) return false;
  const std::uint64_t room = allowance - std::min(allowance, *used_bytes);
  const std::uint64_t divided = divided_mesh_bytes(use.mesh, parts);
  if (divided <= room && asked_method(use.settings, options) != kDefaultMethod) return false;
  const std::uint64_t bytes = PointTiles::bytes(parts);
  if (bytes > room) return false;
  *used_bytes += bytes;
  if (tile_cache_ == nullptr) {
    // So many at least, that no picture is made tile by tile for every ray.
    constexpr std::uint64_t kLeast = std::uint64_t{16} << 20;
    const std::uint64_t cache = std::min(options.computed_bytes, std::max(room - bytes, kLeast));
    tile_cache_ = std::make_unique<PointTileCache>(cache);
    *used_bytes += cache;
  }
  reasons_.push_back("mesh '" + use.mesh_name + "': rays are traced over tiles of it, as dividing it would take " +
                     gibibytes(divided));
  return true;
}

VertexMove DisplacementSet::vector_move_of(const Use& use,
                                           const DisplacementOptions& options,
                                           std::vector<LatticeTriangle>* parts,
                                           std::uint64_t* used_bytes)
{
  const std::string mesh = "mesh '" + use.mesh_name + "'";
  const ComputedHeights& by = *use.heights;
  if (use.mesh.num_triangles == 0 || by.is_constant) return VertexMove::kOwn;
  std::uint64_t allowance = dicing_allowance(options);
  if (by.num_cells > 0) {
    *parts = lattices_make(use.mesh, by.num_cells);
    if (fits_in_tiles(use, options, *parts, allowance, used_bytes)) return VertexMove::kNone;
    *used_bytes += divided_mesh_bytes(use.mesh, *parts);
    return VertexMove::kDivided;
  }
  const double cells = mean_cells_a_side(use.mesh, by.cells);
  VertexMove move = is_dense(use.settings, use.mesh, cells) ? VertexMove::kOwn : VertexMove::kDivided;
  if (options.choices != nullptr) {
    const auto [known, is_new] = options.choices->moved.try_emplace(
        {use.mesh_name, use.displacement_index, use.mesh.num_triangles, use.scale, 0, 0, options.picture_height, 0},
        move);
    move = known->second;
    if (is_new) allowance /= 2;
  }
  char text[96];
  if (move == VertexMove::kOwn) {
    std::snprintf(text, sizeof text, ": its vertices are moved, as its triangles are %.2g cells wide in the mean",
                  cells);
    reasons_.push_back(mesh + text);
    return move;
  }
  const std::uint64_t room = allowance - std::min(allowance, *used_bytes);
  const auto warn_longer = [&](double longer) {
    std::snprintf(text, sizeof text, " has triangles %.0f times as long as asked for: finer ones have no room in %s",
                  longer, gibibytes(room).c_str());
    unfollowed_.push_back(mesh + text + " (--displacement-memory)");
  };
  for (double longer = 1;; longer *= 2) {
    *parts = lattices_make(
        use.mesh, [&](Vec3f a, Vec3f b) { return by.cells_seen(a, b) / (kDividedCells * longer); }, options.require,
        use.settings.most_cells);
    if (fits_in_tiles(use, options, *parts, allowance, used_bytes)) {
      if (longer > 1) warn_longer(longer);
      return VertexMove::kNone;
    }
    // What deforms has its vertices more than once, and larger nodes.
    const std::uint64_t bytes = (use.steps.empty() ? 1 : 2) * divided_mesh_bytes(use.mesh, *parts);
    const bool is_whole = std::all_of(parts->begin(), parts->end(), [](const LatticeTriangle& p) { return p.n == 1; });
    if (bytes > room && !(is_whole && parts->size() == use.mesh.num_triangles)) continue;
    *used_bytes += bytes;
    std::snprintf(text, sizeof text, ": it is divided to the picture, which takes %s", gibibytes(bytes).c_str());
    reasons_.push_back(mesh + text);
    if (longer > 1) warn_longer(longer);
    return move;
  }
}

MovedMesh DisplacementSet::make_moved(const Use& use, VertexMove move, std::span<const LatticeTriangle> parts)
{
  const DisplacementSettings& settings = use.settings;
  const VertexDisplacement by{use.scale, settings.midlevel, settings.smoothing};
  MovedMesh moved;
  if (settings.by_vectors) {
    const PointMoves& moves = use.heights->moves;
    moved = move == VertexMove::kDivided ? divided_mesh_make(use.mesh, moves, parts, by.smooth, use.steps)
                                         : moved_mesh_make(use.mesh, moves, by.smooth, use.steps);
  } else if (move == VertexMove::kDivided) {
    moved = divided_mesh_make(use.mesh, use.heights->source, parts, by);
  } else if (use.heights != nullptr) {
    moved = moved_mesh_make(use.mesh, use.heights->corners, by);
  } else {
    const MapHeights map{&use.mesh, settings.height, &fields_->field(map_of(use), 0).bounds.view()};
    moved = moved_mesh_make(use.mesh, corner_heights(map.source()), by);
  }
  moved.name = use.mesh_name;
  moved.mesh_index = use.mesh_index;
  return moved;
}

BorderSide DisplacementSet::border_side(const DisplacementInput& input,
                                        std::size_t instance,
                                        const PartsOfMoved& parts) const
{
  if (geometry_of_instance_[instance] >= 0) {
    const PreparedMesh& d = displaced(instance);
    if (d.tiles != nullptr) return border_of_tiles(*d.tiles);
    if (d.tessellation == nullptr) return border_of_displaced(d.geometry);
    return border_of_tessellation(*d.tessellation,
                                  d.dicing != nullptr ? d.dicing->parts() : std::span<const LatticeTriangle>{});
  }
  const auto index = static_cast<std::size_t>(input.instances[instance].mesh_index);
  const MeshView& mesh = meshes_[index];
  std::vector<const Vec3f*> steps;
  if (const int moved_index = moved_of_instance_[instance]; moved_index >= 0) {
    const MovedMesh& moved = moved_[static_cast<std::size_t>(moved_index)];
    if (moved.divided != nullptr) return border_of_divided(moved, parts[static_cast<std::size_t>(moved_index)]);
    for (const MovedShape& step : moved.steps) steps.push_back(step.P.data());
    if (steps.empty()) steps.push_back(moved.P.data());
  } else {
    if (index < input.mesh_steps.size()) {
      for (const MeshShape& step : input.mesh_steps[index]) steps.push_back(step.P);
    }
    if (steps.empty()) steps.push_back(mesh.P);
  }
  return border_of_vertices(mesh.triangles, std::move(steps));
}

void DisplacementSet::make_borders(const DisplacementInput& input, const PartsOfMoved& parts)
{
  // What stands in several places has one strip: by its mesh, and what the sides are traced as.
  using Key = std::tuple<int, int, int, int, int>;
  const auto key_of = [&](const DisplacedBorder& border) {
    const std::size_t a = border.sides[0], b = border.sides[1];
    return Key{input.instances[border.instance].mesh_index, geometry_of_instance_[a], moved_of_instance_[a],
               geometry_of_instance_[b], moved_of_instance_[b]};
  };
  // What tracers round, of the coordinates of their rays: those of points in the world, and on the way to object space.
  constexpr double kRounding = 0x1p-21;
  std::map<Key, double> roundings;
  for (const DisplacedBorder& border : input.borders) {
    const DisplacedInstance& instance = input.instances[border.instance];
    const MeshView& mesh = meshes_[static_cast<std::size_t>(instance.mesh_index)];
    Vec3f extent{};
    for (std::uint32_t v = 0; v < mesh.num_vertices; ++v) extent = max(extent, abs(mesh.P[v]));
    for (const std::size_t side : border.sides) {
      if (geometry_of_instance_[side] < 0) continue;
      const Box3 box = bounds(static_cast<std::size_t>(geometry_of_instance_[side]));
      if (box.low.x <= box.high.x) extent = max(extent, max(abs(box.low), abs(box.high)));
    }
    const Affine3& m = instance.world_from_object;
    const Vec3f world = abs(m.x) * extent.x + abs(m.y) * extent.y + abs(m.z) * extent.z + abs(m.p);
    const double size = std::max(static_cast<double>(max_component(extent)),
                                 static_cast<double>(max_component(world)) / stretch_of(m).least);
    double& rounding = roundings[key_of(border)];
    rounding = std::max(rounding, kRounding * size);
  }
  std::map<Key, int> known;
  for (const DisplacedBorder& border : input.borders) {
    const Key key = key_of(border);
    const auto [at, is_new] = known.try_emplace(key, static_cast<int>(moved_.size()));
    moved_of_instance_[border.instance] = at->second;
    if (!is_new) continue;
    const auto index = static_cast<std::size_t>(input.instances[border.instance].mesh_index);
    const BorderSide sides[2] = {border_side(input, border.sides[0], parts),
                                 border_side(input, border.sides[1], parts)};
    const std::size_t num_steps = index < input.mesh_steps.size() ? input.mesh_steps[index].size() : 0;
    const auto mesh_of = [&](int side) {
      return meshes_[static_cast<std::size_t>(input.instances[border.sides[side]].mesh_index)];
    };
    const MeshView meshes[2] = {mesh_of(0), mesh_of(1)};
    BorderStrips strips = border_strips_make(border.edges, meshes_[index], meshes, sides, num_steps, roundings[key]);
    for (int side = 0; side < 2; ++side) {
      const int geometry = geometry_of_instance_[border.sides[side]];
      if (geometry >= 0)
        walls_beside_add(border.edges, strips, side, &geometries_[static_cast<std::size_t>(geometry)]->walls);
    }
    strips.mesh.name = input.mesh_names[index];
    strips.mesh.mesh_index = static_cast<int>(index);
    moved_.push_back(std::move(strips.mesh));
    ++num_borders_;
  }
}

std::unique_ptr<PreparedMesh> DisplacementSet::make_computed(const Use& use, const DisplacementOptions& options)
{
  const ComputedHeights& heights = *use.heights;
  auto displaced = std::make_unique<PreparedMesh>();
  displaced->name = use.mesh_name;
  displaced->displacement_index = use.displacement_index;
  displaced->mesh_index = use.mesh_index;
  displaced->method = kDefaultMethod;
  if (lattice_cache_ == nullptr) lattice_cache_ = std::make_unique<LatticeCache>(options.computed_bytes);
  HeightSource source = heights.source;
  if (source.eval == nullptr && use.settings.height.texture_index >= 0) {
    displaced->map_heights = std::make_unique<MapHeights>(
        MapHeights{&use.mesh, use.settings.height, &fields_->field(map_of(use), 0).bounds.view()});
    source = displaced->map_heights->source();
  }
  if (use.settings.curved && use.mesh.N != nullptr && use.scale != 0) {
    displaced->curved =
        std::make_unique<CurvedHeights>(CurvedHeights{use.mesh, source, use.scale, use.settings.midlevel});
    source = displaced->curved->source();
  }
  displaced->procedural = std::make_unique<ProceduralField>(
      source,
      heights.num_cells > 0 ? lattices_make(use.mesh, heights.num_cells)
                            : lattices_make(use.mesh, heights.cells, options.require, use.settings.most_cells),
      use.settings.midlevel, *lattice_cache_);
  displaced->mesh = DisplacedMesh(use.mesh, *displaced->procedural,
                                  {.height = {}, .scale = use.scale, .midlevel = use.settings.midlevel}, use.steps);
  DisplacedGeometry& geometry = displaced->geometry;
  geometry.method = displaced->method;
  geometry.smooth = use.settings.smoothing;
  geometry.procedural = displaced->procedural.get();
  geometry.mesh = displaced->mesh.view();
  return displaced;
}

std::unique_ptr<PreparedMesh> DisplacementSet::make_tiled(const Use& use, std::vector<LatticeTriangle> parts)
{
  auto displaced = std::make_unique<PreparedMesh>();
  displaced->name = use.mesh_name;
  displaced->displacement_index = use.displacement_index;
  displaced->mesh_index = use.mesh_index;
  displaced->tiles = std::make_unique<PointTiles>(use.mesh, use.heights->moves, std::move(parts),
                                                  use.settings.smoothing, *tile_cache_, num_tiles_);
  num_tiles_ += displaced->tiles->num_tiles();
  displaced->geometry.tiles = displaced->tiles.get();
  return displaced;
}

void DisplacementSet::tessellate(PreparedMesh& displaced,
                                 const DisplacementOptions& options,
                                 bool is_auto,
                                 double num_rays,
                                 std::uint64_t* used_bytes)
{
  const DisplacedMeshView& mesh = displaced.geometry.mesh;
  const auto layout_of = [&](DisplacementMethod method) {
    return tessellation_layout_make(mesh, *displacement_method(method).tessellation, options.tessellation_rate);
  };
  if (displacement_method(displaced.method).tessellation) {
    TessellationLayout layout = layout_of(displaced.method);
    *used_bytes += tessellation_peak_bytes(layout, kRenderTessellation);
    check_budget(*used_bytes, layout, displaced.name, options);
    displaced.tessellation = std::make_unique<Tessellation>(mesh, std::move(layout));
    forget_tree(displaced);
    return;
  }
  // Layouts cost time and memory of their own, so nothing is made of them without an allowance.
  if (!is_auto || options.auto_bytes <= *used_bytes || displaced.geometry.lod.fixed > 0) return;
  const std::uint64_t allowance = options.auto_bytes - *used_bytes;
  const double seconds = method_seconds(*displacement_method(displaced.method).cost, 0, num_rays);
  std::vector<MethodOffer> offers;
  std::vector<TessellationLayout> layouts;
  for (const DisplacementMethod method : kDisplacementMethods) {
    const DisplacementMethodEntry& entry = displacement_method(method);
    if (!entry.cost) continue;
    offers.push_back({method, *entry.cost, 0, 0});
    layouts.emplace_back();
    if (!entry.tessellation) continue;
    const auto offer = [&](const TessellationLayout& layout) {
      offers.back().num_micro_triangles = layout.num_micro_triangles;
      offers.back().bytes = tessellation_peak_bytes(layout, kRenderTessellation);
    };
    // What cannot win as it is at least is not laid out, which takes longer than tracing a small picture of a mesh of millions.
    offer(tessellation_layout_least(mesh, *entry.tessellation, options.tessellation_rate));
    if (offers.back().bytes > allowance ||
        method_seconds(*entry.cost, offers.back().num_micro_triangles, num_rays) >= seconds) {
      continue;
    }
    layouts.back() = layout_of(method);
    offer(layouts.back());
  }
  const DisplacementChoice choice = displacement_choose(offers, num_rays, allowance);
  reasons_.push_back("mesh '" + displaced.name + "': " + choice.reason);
  if (choice.method == displaced.method) return;
  displaced.method = choice.method;
  const auto chosen =
      std::find_if(offers.begin(), offers.end(), [&](const MethodOffer& o) { return o.method == choice.method; });
  *used_bytes += chosen->bytes;
  displaced.tessellation =
      std::make_unique<Tessellation>(mesh, std::move(layouts[static_cast<std::size_t>(chosen - offers.begin())]));
  forget_tree(displaced);
}

void DisplacementSet::dice(PreparedMesh& displaced,
                           const Use& use,
                           const DisplacementOptions& options,
                           double num_rays,
                           std::uint64_t* used_bytes)
{
  std::uint64_t allowance = dicing_allowance(options);
  const double error = options.error * static_cast<double>(use.settings.cell_pixels);
  bool* is_diced = nullptr;  // of the pictures before and after
  if (options.choices != nullptr) {
    const auto [known, is_new] =
        options.choices->is_diced.try_emplace({use.mesh_name, use.displacement_index, use.mesh.num_triangles, use.scale,
                                               error, options.num_rays, options.picture_height, allowance},
                                              false);
    if (!is_new && !known->second) {
      reasons_.push_back("mesh '" + displaced.name + "': not diced, as it was not in a picture before");
      return;
    }
    is_diced = &known->second;
    // In the first picture with room for what the others may take more.
    if (is_new) allowance /= 2;
  }
  const bool was_diced = is_diced != nullptr && *is_diced;
  allowance -= std::min(allowance, *used_bytes);
  if (Dicing::least_bytes(use.mesh) > allowance) {
    if (is_diced != nullptr) *is_diced = false;
    reasons_.push_back("mesh '" + displaced.name + "': not diced, as its triangles alone are too many for that");
    return;
  }
  DisplacedGeometry& geometry = displaced.geometry;
  // However it is diced, a mesh has the triangles that it has. Of one with millions counting the others takes longer than tracing
  // it for a small picture.
  const double seconds = method_seconds(*displacement_method(geometry.method).cost, 0, num_rays);
  const double diced_seconds = method_seconds(kDicingCost, use.mesh.num_triangles, num_rays);
  if (diced_seconds >= seconds && !was_diced) {
    if (is_diced != nullptr) *is_diced = false;
    char text[96];
    std::snprintf(text, sizeof text, "%.2g s by %s against %.2g s or more by tessellate", seconds,
                  displacement_method_label(geometry.method).data(), diced_seconds);
    reasons_.push_back("mesh '" + displaced.name + "': " + text);
    return;
  }
  const HeightFields::Map& map = map_of(use);
  std::vector<const HeightFieldView*> levels;
  std::vector<int> new_levels;
  for (int k = 0; k < num_useful_levels(use); ++k) {
    if (!fields_->has(map, k)) new_levels.push_back(k);
    levels.push_back(&fields_->field(map, k).bounds.view());
  }
  const MapDensity density = map_density(use.mesh, use.settings.height);
  const double texel = 1 / std::sqrt(std::max(density.u * map.view.width * density.v * map.view.height, 1e-300));
  auto dicing = std::make_unique<Dicing>(use.mesh, geometry.mesh, levels, texel, picture_view(use, options), use.places,
                                         error, options.require);
  const TessellationRule rule = dicing->rule();
  TessellationLayout layout = tessellation_layout_make(dicing->mesh(), TessellationKind::kQuads, rule);
  const std::uint64_t bytes = tessellation_peak_bytes(layout, kRenderTessellation) + dicing->bytes();
  const MethodOffer offers[] = {
      {geometry.method, *displacement_method(geometry.method).cost, 0, 0},
      {DisplacementMethod::tessellate, kDicingCost, layout.num_micro_triangles, bytes},
  };
  DisplacementChoice choice = displacement_choose(offers, num_rays, allowance);
  if (was_diced && bytes <= allowance)
    choice = {DisplacementMethod::tessellate, choice.reason + "; diced as in a picture before"};
  if (is_diced != nullptr) *is_diced = choice.method != displaced.method;
  reasons_.push_back("mesh '" + displaced.name + "': " + choice.reason);
  if (choice.method == displaced.method) {
    for (const int k : new_levels) fields_->drop(map, k);
    return;
  }
  *used_bytes += bytes;
  displaced.method = choice.method;
  for (std::size_t k = 0; k < levels.size(); ++k) geometry.levels[k] = {levels[k], nullptr};
  geometry.lod = {static_cast<int>(levels.size()), false, 0, geometry.lod.texel};
  set_facets(use, &geometry, true);
  has_facets_ |= geometry.facets.has_value();
  displaced.tessellation = std::make_unique<Tessellation>(dicing->mesh(), std::move(layout), rule);
  displaced.dicing = std::move(dicing);
  forget_tree(displaced);
}

int DisplacementSet::num_faithful_levels(const Use& use, int most)
{
  const TextureRef& mapping = use.settings.height;
  const double scale = std::abs(use.scale);
  const MapDensity density = map_density(use.mesh, mapping);
  const HeightFields::Map& map = map_of(use);
  const double texel = 1 / std::sqrt(std::max(density.u * map.view.width * density.v * map.view.height, 1e-300));
  LevelLoss lost;
  for (int k = 1; k < most; ++k) {
    const bool is_new = !fields_->has(map, k);
    lost = lost + fields_->loss(map, k);
    const double slope = use.steepening * scale * (lost.slope_u * density.u + lost.slope_v * density.v);
    const double texels = scale * lost.height / (texel * (1 << k));
    if (slope <= kMostSlopeLost && texels <= kMostTexelsLost) continue;
    if (is_new) fields_->drop(map, k);
    return k;
  }
  return most;
}

void DisplacementSet::leave_walls(const PreparedMesh& d, const InstanceView& placement, DisplacedPoint* point) const
{
  // As on plain meshes: the sharper the angle, the farther from a wall a height above the surface is clear of it.
  constexpr double kHeights = 16;
  const LeavingErrors errors = leaving_errors(placement, point->P, point->Ng);
  const double u = static_cast<double>(point->u), v = static_cast<double>(point->v);
  const Vec3d leave =
      d.walls.leave(meshes_[static_cast<std::size_t>(d.mesh_index)], point->triangle, {1 - u - v, u, v},
                    to_double(point->Ng), kHeights * length(to_double(errors.offset)) + length(errors.error));
  if (dot(leave, leave) == 0) return;
  if (is_zero(point->leave)) point->leave = errors.offset;
  point->leave += to_float(leave);
}

DisplacedPoint DisplacementSet::resolve(std::size_t instance,
                                        const InstanceView& placement,
                                        std::uint32_t primitive,
                                        EmbreeHitRecord record) const
{
  const PreparedMesh& d = displaced(instance);
  if (d.tiles != nullptr) {
    DisplacedPoint out = d.tiles->resolve(placement, primitive, record);
    if (!d.walls.edges.empty()) leave_walls(d, placement, &out);
    return out;
  }
  if (d.tessellation == nullptr) {
    DisplacedPoint out = displaced_resolve(d.geometry, placement, texel_of_instance_[instance], primitive, record);
    if (d.procedural != nullptr) set_base_place(*d.procedural, &out);
    if (!d.walls.edges.empty()) leave_walls(d, placement, &out);
    return out;
  }
  const MicroHit hit = d.tessellation->hit(primitive, record.u, record.v);
  DisplacedPoint out{hit.triangle, static_cast<float>(hit.b1), static_cast<float>(hit.b2)};
  out.P = to_float(hit.P);
  out.Ng = out.Ns = to_float(hit.Ng);
  if (d.geometry.scene != nullptr) {
    const LeavingErrors errors = leaving_errors(placement, out.P, out.Ng);
    out.leave = to_float(d.tessellation->leave(d.geometry.scene, primitive, record.u, record.v, hit, errors.error,
                                               2 * length(errors.reach)));
  }
  auto level = static_cast<float>(d.geometry.first_level);
  if (d.dicing != nullptr) {
    const Vec3d P = base_point(d.dicing->mesh().triangles[hit.triangle], hit.b1, hit.b2).P;
    level = static_cast<float>(d.dicing->level(P));
    d.dicing->set_base_place(&out.triangle, &out.u, &out.v);
  }
  if (d.geometry.smooth) {
    out.Ns = to_float(displaced_smooth_normal(d.geometry, out.triangle, {out.u, out.v}));
  } else if (d.dicing != nullptr && !(level > 0.0f)) {
    // Micro-triangles across the line between two texels would show as teeth where texels are wider than pixels.
    out.Ns = to_float(displaced_surface_point(d.geometry, out.triangle, {out.u, out.v}).Ng);
  }
  displaced_point_set_level(d.geometry, placement, level, &out);
  if (!d.walls.edges.empty()) leave_walls(d, placement, &out);
  return out;
}

DisplacedPoint DisplacementSet::locate(std::size_t instance, std::uint32_t primitive, EmbreeHitRecord record) const
{
  const PreparedMesh& d = displaced(instance);
  if (d.tiles != nullptr) return d.tiles->locate(primitive, record);
  if (d.tessellation == nullptr) {
    DisplacedPoint out{primitive, record.u, record.v};
    if (d.procedural != nullptr) set_base_place(*d.procedural, &out);
    return out;
  }
  const MicroHit hit = d.tessellation->locate(primitive, record.u, record.v);
  DisplacedPoint out{hit.triangle, static_cast<float>(hit.b1), static_cast<float>(hit.b2)};
  if (d.dicing != nullptr) d.dicing->set_base_place(&out.triangle, &out.u, &out.v);
  return out;
}

SeamReport DisplacementSet::seams(std::size_t index) const
{
  // Of computed heights no sides are compared.
  const PreparedMesh& d = *geometries_[index];
  return d.procedural == nullptr && d.tiles == nullptr ? seam_report(d.mesh.view()) : SeamReport{};
}

Box3 DisplacementSet::bounds(std::size_t index) const
{
  const PreparedMesh& d = *geometries_[index];
  return d.tiles != nullptr ? d.tiles->bounds() : d.mesh.bounds();
}

DisplacementSet::TileTally DisplacementSet::tiles() const
{
  if (tile_cache_ == nullptr) return {};
  return {tile_cache_->num_made(), tile_cache_->num_evicted(), tile_cache_->bytes()};
}

std::size_t DisplacementSet::bytes() const
{
  std::size_t sum = fields_->bytes() + (lattice_cache_ != nullptr ? lattice_cache_->bytes() : 0) + tiles().bytes;
  for (const MovedMesh& mesh : moved_) sum += mesh.bytes();
  for (const auto& displaced : geometries_) {
    sum += displaced->mesh.bytes();
    if (displaced->procedural != nullptr) sum += displaced->procedural->bytes();
    if (displaced->dicing != nullptr) sum += displaced->dicing->bytes();
    if (displaced->tessellation != nullptr) sum += displaced->tessellation->bytes();
    if (displaced->tiles != nullptr) sum += displaced->tiles->bytes();
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
  for (const DisplacementMethod method : kDisplacementMethods) {
    const auto uses = [=](const auto& displaced) { return displaced->method == method && displaced->tiles == nullptr; };
    if (std::none_of(geometries_.begin(), geometries_.end(), uses)) continue;
    names += (names.empty() ? "" : ", ") + std::string(displacement_method_label(method));
  }
  if (num_tiles_ > 0) names += names.empty() ? "tiles" : ", tiles";
  if (moved_.size() > num_borders_) names += names.empty() ? "vertices" : ", vertices";
  return names;
}

std::vector<std::string> DisplacementSet::warnings() const
{
  std::vector<std::string> texts = unfollowed_;
  for (const auto& displaced : geometries_) {
    const DisplacedMeshReport& report = displaced->mesh.report();
    const std::string of = " of " + std::to_string(displaced->geometry.mesh.num_triangles) + " triangles of mesh '" +
                           displaced->name + "' ";
    if (report.num_degenerate > 0) {
      texts.push_back(std::to_string(report.num_degenerate) + of +
                      "have no normal to be displaced along and are left out");
    }
    if (displaced->procedural != nullptr && displaced->procedural->is_sampled()) {
      texts.push_back(
          "the heights of mesh '" + displaced->name +
          "' have no bounds that are known; those beyond what some points of it have, and as much again, are "
          "cut off");
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

}  // namespace relief
