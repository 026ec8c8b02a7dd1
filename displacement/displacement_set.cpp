#include "displacement/displacement_set.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <tuple>
#include <utility>

#include "displacement/displacement_choice.h"
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

}  // namespace

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
  const std::vector<double> shares = shares_of(uses, options);
  std::uint64_t tessellated_bytes = 0;
  std::vector<std::pair<int, int>> places;  // of each use: its geometry or its moved mesh
  PartsOfMoved parts_of_moved;
  for (std::size_t k = 0; k < uses.size(); ++k) {
    const Use& use = uses[k];
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
      geometries_.push_back(parts.empty() ? make_computed(use, options) : make_tiled(use, std::move(parts)));
      continue;
    }
    geometries_.push_back(make_displaced(use, options));
    const double num_rays = options.num_rays * shares[k];
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
