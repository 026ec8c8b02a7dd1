#include "displacement/displacement_set.h"

#include <algorithm>
#include <cstdio>

#include "displacement/displacement_choice.h"

namespace relief {

namespace {

/// Computed heights over triangles of so many cells along a side, in the mean, are those of their vertices, as in Cycles: whoever
/// divided a mesh so finely did it for these, and tracing what is between takes 4 to 40 times as long (noise on 640 × 640 quads at
/// 320 × 180 pixels 294 processor seconds instead of 7, cracks on 200 × 200 at 1280 × 720, of six cells, 78 instead of 9).
constexpr double kMostMovedCells = 16;

/// Of maps, pixels: between vertices so close a ray finds no more than the picture can show, and takes seven times as long to find
/// it. Whoever divides a mesh so finely has it displaced at its vertices by every other renderer.
constexpr double kMostMovedPixels = 2;

/// Triangles of up to so many times that are divided, where surfaces may err by pixels: each into sixteen at most.
constexpr double kMostHalved = 4;

/// Sides of divided triangles, cells at most: lattices have powers of two, so they are one to two cells long. Of one cell and less
/// there would be four times as many.
constexpr double kDividedCells = 2;

/// A mesh of fewer triangles was not divided to be displaced: however small it is now, the camera may come near.
constexpr std::uint32_t kLeastMovedTriangles = 64;

/// The same under a map, which is exact in what is near: of fewer there is little to gain.
constexpr std::uint32_t kLeastMapTriangles = 10'000;

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

}  // namespace

bool map_may_move_vertices(const DisplacementSettings& settings, std::size_t num_triangles)
{
  return !displacement_is_computed(settings) && !settings.divide && num_triangles >= kLeastMapTriangles;
}

namespace {

/// How often the sides of a mesh's triangles are halved before its vertices move.
int halvings(VertexMove move) { return move == VertexMove::kHalved ? 1 : move == VertexMove::kQuartered ? 2 : 0; }

}  // namespace

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
  if (use.heights == nullptr) return map_move_of(use, options, used_bytes);
  if (use.heights->num_cells > 0) return VertexMove::kNone;
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
    // Another picture may have room for the mesh of the same triangles: what is chosen stays.
    if (fits_in_tiles(use, options, *parts, allowance, used_bytes)) return VertexMove::kNone;
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

VertexMove DisplacementSet::map_move_of(const Use& use, const DisplacementOptions& options, std::uint64_t* used_bytes)
{
  if (!options.camera || options.picture_height <= 0 || lod_of(use.settings, options) > 0 ||
      !map_may_move_vertices(use.settings, use.mesh.num_triangles)) {
    return VertexMove::kNone;
  }
  VertexMove of_this_picture = VertexMove::kNone;
  VertexMove* chosen = &of_this_picture;
  bool is_first = true;
  std::uint64_t allowance = dicing_allowance(options);
  if (options.choices != nullptr) {
    const auto [known, is_new] =
        options.choices->moved.try_emplace({use.mesh_name, use.displacement_index, use.mesh.num_triangles, use.scale,
                                            options.error, 0, options.picture_height, 0},
                                           VertexMove::kNone);
    chosen = &known->second;
    is_first = is_new;
    if (is_new) allowance /= 2;
  }
  if (!is_first && *chosen == VertexMove::kNone) return VertexMove::kNone;
  const SeenInstances seen(use.mesh, picture_view(use, options), use.places, SeenInstances::Coarser::kOutside);
  const double pixels = mean_pixels_a_side(use.mesh, seen) / static_cast<double>(use.settings.cell_pixels);
  if (is_first) {
    // Where surfaces may err, divided as finely as all else is.
    const double most = options.error > 0 ? kDividedCells * options.error : kMostMovedPixels;
    const bool may_halve = options.error > 0 && !use.has_borders;
    *chosen = pixels <= most                                  ? VertexMove::kOwn
              : may_halve && pixels <= kMostHalved / 2 * most ? VertexMove::kHalved
              : may_halve && pixels <= kMostHalved * most     ? VertexMove::kQuartered
                                                              : VertexMove::kNone;
  }
  const std::uint64_t bytes = halvings(*chosen) > 0 ? halved_mesh_bytes(use.mesh, halvings(*chosen)) : 0;
  if (bytes > allowance - std::min(allowance, *used_bytes)) *chosen = VertexMove::kNone;
  if (*chosen == VertexMove::kNone) return VertexMove::kNone;
  *used_bytes += bytes;
  char text[96];
  std::snprintf(text, sizeof text, "its vertices are moved, as its triangles are %.2g pixels wide in the picture",
                pixels);
  std::string reason = "mesh '" + use.mesh_name + "': " + text;
  if (bytes > 0) {
    std::snprintf(text, sizeof text, "; each is divided into %d, which takes ", 1 << 2 * halvings(*chosen));
    reason += text + gibibytes(bytes);
  }
  reasons_.push_back(reason);
  return *chosen;
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
    MovedMesh halved;
    if (halvings(move) > 0) halved = halved_mesh_make(use.mesh, halvings(move));
    const MeshView mesh = halvings(move) > 0 ? halved.view(use.mesh) : use.mesh;
    const MapHeights map{&mesh, settings.height, &fields_->field(map_of(use), 0).bounds.view()};
    moved = moved_mesh_make(mesh, corner_heights(map.source()), by);
    moved.divided = halved.divided;
  }
  moved.name = use.mesh_name;
  moved.mesh_index = use.mesh_index;
  return moved;
}

std::unique_ptr<PreparedMesh> DisplacementSet::make_tiled(const Use& use, std::vector<LatticeTriangle> parts)
{
  auto displaced = std::make_unique<PreparedMesh>();
  displaced->name = use.mesh_name;
  displaced->displacement_index = use.displacement_index;
  displaced->mesh_index = use.mesh_index;
  const DisplacementSettings& settings = use.settings;
  PointMover mover = settings.by_vectors
                         ? point_mover_make(use.heights->moves)
                         : point_mover_make(use.heights->source, {use.scale, settings.midlevel, settings.smoothing});
  displaced->tiles = std::make_unique<PointTiles>(use.mesh, std::move(mover), std::move(parts), settings.smoothing,
                                                  *tile_cache_, num_tiles_);
  num_tiles_ += displaced->tiles->num_tiles();
  displaced->geometry.tiles = displaced->tiles.get();
  return displaced;
}

}  // namespace relief
