// Rays through a tile of micro-triangles. Compiled once an instruction set, RELIEF_ISA, as the methods are.
//
// Points are brought to the plane across the ray in double precision, each on its own, and rounded there: so what triangles have in
// common, sides and points, is in one place for all of them, whatever tiles they are in. Which side of a line the ray is on is then told
// exactly. No ray passes between triangles, nor through a point (Woop and others 2013, "Watertight Ray/Triangle Intersection", with
// their rounding after the ray's origin is taken off in place of before).
#include "displacement/lanes.h"
#include "displacement/leaf.h"
#include "displacement/point_tiles.h"
#include "displacement/shadow_filter.h"

namespace relief {

namespace {

struct TileRay {
  double O[3], D[3];       ///< object space
  double inverse[3];       ///< of D, finite
  int across[2], along;    ///< axes: the ray goes along one most
  double shear[2], scale;  ///< a point's places are P[across] − shear · P[along] and scale · P[along], from O
  double t_min, t_max;
};

TileRay tile_ray_make(const EmbreeContext& context, RTCRayN* rays, unsigned count, unsigned k)
{
  TileRay ray{{RTCRayN_org_x(rays, count, k), RTCRayN_org_y(rays, count, k), RTCRayN_org_z(rays, count, k)},
              {RTCRayN_dir_x(rays, count, k), RTCRayN_dir_y(rays, count, k), RTCRayN_dir_z(rays, count, k)},
              {},
              {},
              2,
              {},
              1,
              RTCRayN_tnear(rays, count, k),
              RTCRayN_tfar(rays, count, k)};
  if (const ObjectRay* const object = context.object_ray) {
    const Vec3d O = object->O, D = object->D;
    ray.O[0] = O.x, ray.O[1] = O.y, ray.O[2] = O.z;
    ray.D[0] = D.x, ray.D[1] = D.y, ray.D[2] = D.z;
  }
  double size[3];
  for (int axis = 0; axis < 3; ++axis) size[axis] = __builtin_fabs(ray.D[axis]);
  ray.along = size[0] > size[1] ? (size[0] > size[2] ? 0 : 2) : (size[1] > size[2] ? 1 : 2);
  ray.across[0] = (ray.along + 1) % 3;
  ray.across[1] = (ray.along + 2) % 3;
  ray.scale = 1 / ray.D[ray.along];
  for (int k2 = 0; k2 < 2; ++k2) ray.shear[k2] = ray.D[ray.across[k2]] * ray.scale;
  // Of directions within a plane, boxes are met that contain the origin or nearly so.
  const double least = 1e-18 * size[ray.along];
  for (int axis = 0; axis < 3; ++axis)
    ray.inverse[axis] = 1 / (size[axis] < least ? __builtin_copysign(least, ray.D[axis]) : ray.D[axis]);
  return ray;
}

/// A ray in the steps of a tile's boxes: it is at the coordinate q at near + q · step at the earliest, far + q · step at the latest.
struct NodeRay {
  float near[3], far[3], step[3];
  float t_min;
};

NodeRay node_ray_make(const PointTile& tile, const TileRay& ray)
{
  // Where a triangle's places are rounded to floats, the ray is met beside it, by so much of its size. Beside that the roundings of
  // doubles are nothing, but for origins far from the tile. Each t is rounded to floats three times.
  constexpr double kRounding = 0x1p-21, kOfDoubles = 0x1p-50, kOfFloats = 0x1p-22;
  double size = 0;
  for (const float step : tile.step) size += 255.0 * static_cast<double>(step);
  NodeRay out;
  for (int axis = 0; axis < 3; ++axis) {
    const double low = static_cast<double>(tile.low[axis]), inverse = ray.inverse[axis], O = ray.O[axis];
    const double step = static_cast<double>(tile.step[axis]) * inverse, at = (low - O) * inverse;
    const double pad =
        (kRounding * size + kOfDoubles * (__builtin_fabs(low) + __builtin_fabs(O))) * __builtin_fabs(inverse) +
        kOfFloats * (__builtin_fabs(at) + 255 * __builtin_fabs(step));
    out.near[axis] = static_cast<float>(at - pad);
    out.far[axis] = static_cast<float>(at + pad);
    out.step[axis] = static_cast<float>(step);
  }
  out.t_min = static_cast<float>(ray.t_min);
  return out;
}

/// Which of eight boxes a ray may meet before t_max.
/// @param k      the first of them
/// @param enter  receives where, at least
template <int kNum>
unsigned boxes_met(const TileBoxes<kNum>& boxes, int k, const NodeRay& ray, float t_max, float* enter)
{
  F8 from = splat8(ray.t_min), to = splat8(t_max);
  for (int axis = 0; axis < 3; ++axis) {
    const bool rises = ray.step[axis] >= 0.0f;
    const F8 first = load8((rises ? boxes.low : boxes.high)[axis] + k);
    const F8 last = load8((rises ? boxes.high : boxes.low)[axis] + k);
    const F8 step = splat8(ray.step[axis]);
    from = max(from, fused(first, step, splat8(ray.near[axis])));
    to = min(to, fused(last, step, splat8(ray.far[axis])));
  }
  store8(enter, from);
  return mask_of((from <= to) & (load8(boxes.low[0] + k) <= load8(boxes.high[0] + k)));
}

using F4 [[gnu::vector_size(16)]] = float;

D4 load4(const float* from)
{
  F4 lanes;
  __builtin_memcpy(&lanes, from, sizeof lanes);
  return __builtin_convertvector(lanes, D4);
}

F8 join(F4 a, F4 b) { return __builtin_shufflevector(a, b, 0, 1, 2, 3, 4, 5, 6, 7); }

/// Eight points across the ray.
struct Places {
  F8 x, y;
};

/// On which side of the line from the origin to a point others are: positive, negative or neither, exactly. The same but for its sign
/// with the two exchanged.
F8 side_of(const Places& a, const Places& b)
{
  const F8 p = a.x * b.y, q = a.y * b.x;
  F8 side = p - q;
  // Rounding keeps the order of products or makes them equal.
  for (unsigned equal = mask_of(p == q); equal != 0; equal &= equal - 1) {
    const int k = __builtin_ctz(equal);
    const double exact = static_cast<double>(a.x[k]) * static_cast<double>(b.y[k]) -
                         static_cast<double>(a.y[k]) * static_cast<double>(b.x[k]);
    side[k] = exact > 0 ? 1.0f : exact < 0 ? -1.0f : 0.0f;
  }
  return side;
}

/// The eight triangles of a leaf. Lanes 0 to 3: the first ones of cells (0, 0), (1, 0), (0, 1), (1, 1); lanes 4 to 7: the second ones.
struct LeafPlaces {
  Places vertex[3];
  unsigned met = 0;  ///< which of them the ray's line passes through
};

LeafPlaces leaf_make(const PointTile& tile, int at, const TileRay& ray)
{
  F4 rows[2][3];
  for (int r = 0; r < 3; ++r) {
    const int first = at + r * PointTile::kRow;
    const D4 along = load4(tile.P[ray.along] + first) - ray.O[ray.along];
    for (int k = 0; k < 2; ++k) {
      const D4 across = load4(tile.P[ray.across[k]] + first) - ray.O[ray.across[k]];
      rows[k][r] = __builtin_convertvector(across - ray.shear[k] * along, F4);
    }
  }
  LeafPlaces out;
  for (int k = 0; k < 2; ++k) {
    const F8 lower = join(rows[k][0], rows[k][1]), upper = join(rows[k][1], rows[k][2]);
    const auto into = [&](int vertex) -> F8& { return k == 0 ? out.vertex[vertex].x : out.vertex[vertex].y; };
    into(0) = __builtin_shufflevector(lower, upper, 0, 1, 4, 5, 9, 10, 13, 14);
    const F8 side = __builtin_shufflevector(lower, upper, 1, 2, 5, 6, 8, 9, 12, 13);
    into(1) = side;
    into(2) = __builtin_shufflevector(side, side, 4, 5, 6, 7, 0, 1, 2, 3);
  }
  const F8 U = side_of(out.vertex[1], out.vertex[2]), V = side_of(out.vertex[2], out.vertex[0]),
           W = side_of(out.vertex[0], out.vertex[1]);
  const F8 zero = splat8(0.0f);
  out.met = mask_of(((min(min(U, V), W) >= zero) | (max(max(U, V), W) <= zero)));
  return out;
}

struct TileHit {
  double t = 0;
  float u = 0, v = 0;
  int number = 0;  ///< of the triangle, as PointTiles::locate has it
};

/// @param lane  of a leaf at the cell (i, j), met
/// @return      false: the triangle is seen edge-on, or met outside of the range
bool leaf_hit(const PointTile& tile, const LeafPlaces& leaf, int lane, int i, int j, const TileRay& ray, TileHit* hit)
{
  const int second = lane >> 2, ci = i + (lane & 1), cj = j + (lane >> 1 & 1);
  const int points[3][2] = {{ci + second, cj + second}, {ci + 1 - second, cj + second}, {ci + second, cj + 1 - second}};
  double x[3], y[3];
  Vec3d P[3];  // from the ray's origin
  for (int k = 0; k < 3; ++k) {
    x[k] = static_cast<double>(leaf.vertex[k].x[lane]);
    y[k] = static_cast<double>(leaf.vertex[k].y[lane]);
    P[k] = to_double(tile.point(points[k][0], points[k][1])) - Vec3d{ray.O[0], ray.O[1], ray.O[2]};
  }
  const double u = x[2] * y[0] - y[2] * x[0], v = x[0] * y[1] - y[0] * x[1], w = x[1] * y[2] - y[1] * x[2];
  const double sum = u + v + w;
  if (!(sum != 0)) return false;
  // In doubles, not by the weights, which are those of rounded places: a ray that leaves level ground at height 0 starts hardly above
  // it (PointTiles.LevelGroundAtZeroIsLeft). Between the ends of a triangle that is seen nearly edge-on.
  const auto along = [&](int k) { return (ray.along == 0 ? P[k].x : ray.along == 1 ? P[k].y : P[k].z) * ray.scale; };
  const double t0 = along(0), t1 = along(1), t2 = along(2);
  const Vec3d N = cross(P[1] - P[0], P[2] - P[0]);
  const double slope = dot(N, Vec3d{ray.D[0], ray.D[1], ray.D[2]});
  const double met = slope != 0 ? dot(N, P[0]) / slope : (w * t0 + u * t1 + v * t2) / sum;
  const double t = max(min(met, max(t0, max(t1, t2))), min(t0, min(t1, t2)));
  if (!(t >= ray.t_min && t <= ray.t_max)) return false;
  *hit = {t, static_cast<float>(u / sum), static_cast<float>(v / sum), 2 * (cj * PointTile::kCells + ci) + second};
  return true;
}

/// The nearest of some boxes.
int nearest_of(unsigned boxes, const float* enter)
{
  int nearest = __builtin_ctz(boxes);
  for (unsigned left = boxes & (boxes - 1); left != 0; left &= left - 1) {
    const int box = __builtin_ctz(left);
    if (enter[box] < enter[nearest]) nearest = box;
  }
  return nearest;
}

/// Up to which t boxes are entered, not less than what is left of the ray.
float rounded_up(double t) { return static_cast<float>(t * (1 + 0x1p-23)); }

/// Calls visit(hit) with what a ray meets of a tile, about in order; hits shorten the ray where `visit` does.
/// @param visit  whether to go on
template <class Visit>
void tile_visit(const PointTile& tile, TileRay& ray, TraversalCounters& counters, const Visit& visit)
{
  if (traversal_stop(counters)) return;
  const NodeRay node_ray = node_ray_make(tile, ray);
  alignas(32) float node_enter[16], leaf_enter[8];
  ++counters.prisms;
  counters.bounds += 2;
  unsigned nodes = boxes_met(tile.nodes, 0, node_ray, rounded_up(ray.t_max), node_enter) |
                   boxes_met(tile.nodes, 8, node_ray, rounded_up(ray.t_max), node_enter + 8) << 8;
  while (nodes != 0) {
    const int node = nearest_of(nodes, node_enter);
    nodes &= ~(1u << node);
    if (node_enter[node] > rounded_up(ray.t_max)) break;
    ++counters.bounds;
    unsigned leaves = boxes_met(tile.leaves[node], 0, node_ray, rounded_up(ray.t_max), leaf_enter);
    while (leaves != 0) {
      const int nearest = nearest_of(leaves, leaf_enter);
      leaves &= ~(1u << nearest);
      if (leaf_enter[nearest] > rounded_up(ray.t_max)) break;
      ++counters.texels;
      const int i = PointTile::kNodeCells * (node & 3) + PointTile::kLeafCells * (nearest & 1);
      const int j = PointTile::kNodeCells * (node >> 2) + PointTile::kLeafCells * (nearest >> 1);
      const LeafPlaces leaf = leaf_make(tile, j * PointTile::kRow + i, ray);
      for (unsigned met = leaf.met; met != 0; met &= met - 1) {
        TileHit hit;
        if (leaf_hit(tile, leaf, __builtin_ctz(met), i, j, ray, &hit) && !visit(hit)) return;
      }
    }
  }
}

/// Where queries that bring no counters count.
thread_local TraversalCounters uncounted;

/// Counts what a ray takes for those who asked.
class Counted {
 public:
  Counted(const EmbreeContext& context, unsigned id)
      : counters(context.displacement != nullptr ? *context.displacement : uncounted),
        steps_(context.steps != nullptr ? context.steps + id : nullptr),
        before_(counters.bounds + counters.texels)
  {
  }
  ~Counted()
  {
    if (steps_ != nullptr) *steps_ += static_cast<std::uint32_t>(counters.bounds + counters.texels - before_);
  }
  Counted(const Counted&) = delete;
  Counted& operator=(const Counted&) = delete;

  TraversalCounters& counters;

 private:
  std::uint32_t* steps_;
  std::uint64_t before_;
};

/// The codec of hits, see PointTiles::locate.
EmbreeHitRecord tile_hit_encode(const TileHit& hit) { return {hit.u, hit.v, static_cast<float>(hit.number)}; }

}  // namespace

namespace RELIEF_ISA {

void tiles_intersect(const RTCIntersectFunctionNArguments* arguments)
{
  const auto& geometry = *static_cast<const DisplacedGeometry*>(arguments->geometryUserPtr);
  const auto& context = *reinterpret_cast<const EmbreeContext*>(arguments->context);
  const unsigned count = arguments->N;
  RTCRayN* rays = RTCRayHitN_RayN(arguments->rayhit, count);
  RTCHitN* hits = RTCRayHitN_HitN(arguments->rayhit, count);
  const PointTileCache::Pin pin = geometry.tiles->pin(arguments->primID);
  for (unsigned k = 0; k < count; ++k) {
    if (arguments->valid[k] != -1) continue;
    TileRay ray = tile_ray_make(context, rays, count, k);
    const Counted counted(context, RTCRayN_id(rays, count, k));
    TileHit nearest;
    bool found = false;
    tile_visit(pin.tile(), ray, counted.counters, [&](const TileHit& hit) {
      nearest = hit;
      ray.t_max = hit.t;
      return found = true;
    });
    if (!found) continue;
    RTCRayN_tfar(rays, count, k) = static_cast<float>(nearest.t);
    const EmbreeHitRecord record = tile_hit_encode(nearest);
    RTCHitN_u(hits, count, k) = record.u;
    RTCHitN_v(hits, count, k) = record.v;
    RTCHitN_Ng_x(hits, count, k) = record.Ng_x;
    RTCHitN_primID(hits, count, k) = arguments->primID;
    RTCHitN_geomID(hits, count, k) = arguments->geomID;
    RTCHitN_instID(hits, count, k, 0) = arguments->context->instID[0];
  }
}

void tiles_occluded(const RTCOccludedFunctionNArguments* arguments)
{
  const auto& geometry = *static_cast<const DisplacedGeometry*>(arguments->geometryUserPtr);
  const auto& context = *reinterpret_cast<const EmbreeContext*>(arguments->context);
  const unsigned count = arguments->N;
  const PointTileCache::Pin pin = geometry.tiles->pin(arguments->primID);
  for (unsigned k = 0; k < count; ++k) {
    if (arguments->valid[k] != -1) continue;
    TileRay ray = tile_ray_make(context, arguments->ray, count, k);
    const Counted counted(context, RTCRayN_id(arguments->ray, count, k));
    tile_visit(pin.tile(), ray, counted.counters, [&](const TileHit& hit) {
      if (geometry.shadow_filter != nullptr &&
          shadow_filter_passes(geometry.shadow_filter, arguments, k, tile_hit_encode(hit), hit.t)) {
        return true;
      }
      RTCRayN_tfar(arguments->ray, count, k) = -kInfinity;
      return false;
    });
  }
}

}  // namespace RELIEF_ISA

}  // namespace relief
