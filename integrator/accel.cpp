#include "integrator/accel.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstring>
#include <stdexcept>
#include <string>
#include <utility>

#include "integrator/ray_surface.h"
#include "integrator/stages.h"
#include "scene/memory.h"

namespace relief {

namespace {

bool is_identity(const Affine3& m)
{
  return m.x == Vec3f{1, 0, 0} && m.y == Vec3f{0, 1, 0} && m.z == Vec3f{0, 0, 1} && m.p == Vec3f{};
}

std::uint32_t mask_of(std::uint32_t instance_flags)
{
  const std::uint32_t hidden = (instance_flags & kHiddenFrom) >> kHiddenFromShift << kRayBounceShift;
  const std::uint32_t mask = (kRayBounce & ~hidden) |
                             ((instance_flags & kVisibleToCamera) != 0 ? std::uint32_t{kRayCamera} : 0u) |
                             ((instance_flags & kCastsShadow) != 0 ? std::uint32_t{kRayShadow} : 0u);
  return (instance_flags & kShadowCatcher) != 0 ? mask | mask << kRayCatchersShift : mask;
}

/// How a ray stands to the box of what it may hit.
enum class RayStart : std::uint8_t { kNear, kFar, kInvalid };

/// Embree ends the program at rays beyond its limits, among them all that are not numbers.
RayStart ray_start(const RayTarget& target, Vec3f O, Vec3f D, float t_min, float t_max)
{
  constexpr float kLongest = 1e18f;
  const Vec3f size = abs(D);
  const bool valid = size.x <= kLongest && size.y <= kLongest && size.z <= kLongest && !is_zero(D) && t_min >= 0.0f &&
                     t_min <= t_max && t_min < kInfinity;
  if (!valid) return RayStart::kInvalid;
  if (ray_starts_near(target, to_double(O))) return RayStart::kNear;
  return is_finite(O) ? RayStart::kFar : RayStart::kInvalid;
}

RayStart ray_start(const RayTarget& target, const RTCRay& ray)
{
  return ray_start(target, {ray.org_x, ray.org_y, ray.org_z}, {ray.dir_x, ray.dir_y, ray.dir_z}, ray.tnear, ray.tfar);
}

/// A far ray that is moved near, and its range of t with it, while it is traced.
class FarRay {
 public:
  FarRay(const RayTarget& target, EmbreeContext& context, RTCRay* ray) : start_(context.far_start)
  {
    start_.is_far = true;
    start_.O = to_double(Vec3f{ray->org_x, ray->org_y, ray->org_z});
    start_.t = ray_move_near(target, &start_.O, to_double(Vec3f{ray->dir_x, ray->dir_y, ray->dir_z}));
    ray->org_x = static_cast<float>(start_.O.x);
    ray->org_y = static_cast<float>(start_.O.y);
    ray->org_z = static_cast<float>(start_.O.z);
    // Rounded up: rounded down to where a hit was, a ray that goes on behind it would find it again.
    const double from = max(static_cast<double>(ray->tnear) - start_.t, 0.0);
    const auto rounded = static_cast<float>(from);
    ray->tnear = static_cast<double>(rounded) < from ? t_min_behind(rounded) : rounded;
    ray->tfar = static_cast<float>(static_cast<double>(ray->tfar) - start_.t);
    meets_ = start_.t >= 0 && ray->tnear <= ray->tfar;
  }
  ~FarRay() { start_ = {}; }
  FarRay(const FarRay&) = delete;
  FarRay& operator=(const FarRay&) = delete;

  bool meets() const { return meets_; }  ///< the box of what it may hit
  /// t from where the ray started.
  double t(float near_t) const { return static_cast<double>(near_t) + start_.t; }

 private:
  FarStart& start_;
  bool meets_ = false;
};

Box3 points_box(std::span<const Vec3f> points, const Affine3& m)
{
  Box3 box = box_empty();
  for (const Vec3f P : points) {
    const Vec3f P_there = transform_point(m, P);
    box = box_union(box, {P_there, P_there});
  }
  return box;
}

/// Box of a mesh in its own space. A segment of a curve stays within the four points that it has as a cubic of Bézier's, and so does
/// its radius.
Box3 mesh_box(const TreeMesh& mesh, const std::vector<Vec3f>& P)
{
  Box3 box = points_box(P, {});
  if (mesh.radius.empty()) return box;
  if (mesh.are_points) {
    const float most = *std::max_element(mesh.radius.begin(), mesh.radius.end());
    return {box.low - splat3(most), box.high + splat3(most)};
  }
  float widest = 0;
  for (const TriangleIndices& ends : mesh.triangles) {
    const std::uint32_t v = ends.v0;
    for (const Vec3f inner : {P[v] + (P[v + 1] - P[v - 1]) / 6.0f, P[v + 1] - (P[v + 2] - P[v]) / 6.0f}) {
      box = box_union(box, {inner, inner});
    }
    const auto& r = mesh.radius;
    widest =
        std::max({widest, r[v], r[v + 1], r[v] + (r[v + 1] - r[v - 1]) / 6.0f, r[v + 1] - (r[v + 2] - r[v]) / 6.0f});
  }
  return {box.low - splat3(widest), box.high + splat3(widest)};
}

/// Whether a light is so far away that boxes as wide as its distance asks for would be much larger than the things in them:
/// soft suns are. Rays that start beyond the things are moved near, and look for such lights before.
/// @param things  box of all that is not far away
bool is_far_away(const Box3& light, const Box3& things)
{
  constexpr float kFar = 16;
  if (!(things.low.x <= things.high.x)) return false;
  const Vec3f reach = splat3(kFar * length(things.high - things.low));
  const Vec3f beyond = max(max(light.high - (things.high + reach), (things.low - reach) - light.low), splat3(0.0f));
  return !is_zero(beyond);
}

/// So that a pad stays the same where a scene changes a little, and with it the trees whose boxes it enlarges.
float power_of_two_above(float x)
{
  if (!(x > 0.0f && x < kInfinity)) return x;
  int exponent = 0;
  const float fraction = std::frexp(x, &exponent);
  return std::ldexp(1.0f, fraction > 0.5f ? exponent : exponent - 1);
}

/// At least instance_pad along each axis, and about the same however the instance is turned.
float steady_pad(const InstanceGeometry& instance)
{
  const auto row = [&](double Vec3d::*axis) {
    const ObjectFromWorld& m = instance.object_from_world;
    return std::hypot(m.x.*axis, m.y.*axis, m.z.*axis);
  };
  const double longest = std::max({row(&Vec3d::x), row(&Vec3d::y), row(&Vec3d::z)});
  // The sum of three numbers is at most so many times the root of the sum of their squares.
  constexpr double kRootOfThree = 1.7320509;
  return power_of_two_above(static_cast<float>(kRootOfThree * static_cast<double>(*instance.pad) * longest));
}

/// What new_mesh reads of a mesh.
void hash_triangles(const TreeMesh& mesh, ContentHasher* hash)
{
  hash->add_array(mesh.P->data(), mesh.P->size());
  hash->add(mesh.steps.size());
  for (const std::vector<Vec3f>* P : mesh.steps) hash->add_array(P->data(), P->size());
  hash->add_array(mesh.triangles.data(), mesh.triangles.size());
  hash->add_array(mesh.radius.data(), mesh.radius.size());
  hash->add(mesh.are_ribbons, mesh.are_points);
}

/// Whether a tree of quadrilaterals is worth it. Where all triangles are in pairs rays take .83 to 1.01 of the time, and trees .73 of the
/// memory; where none are, 1.03 and 1.45. Rooms of 3,000 triangles, with walls that nearly all rays come near to, take 1.05.
bool pairs_pay(std::size_t num_pairs, std::size_t num_triangles)
{
  constexpr std::size_t kLeastTriangles = 4096;
  constexpr double kMostOfTriangles = 0.75;
  return num_triangles >= kLeastTriangles &&
         static_cast<double>(num_pairs) < kMostOfTriangles * static_cast<double>(num_triangles);
}

void hash_transform(const Affine3& m, ContentHasher* hash)
{
  for (const Vec3f column : {m.x, m.y, m.z, m.p}) hash->add(column.x, column.y, column.z);
}

Box3 scene_bounds(RTCScene scene)
{
  RTCBounds b;
  rtcGetSceneBounds(scene, &b);
  return {{b.lower_x, b.lower_y, b.lower_z}, {b.upper_x, b.upper_y, b.upper_z}};
}

}  // namespace

Accel::Accel(const Scene& scene,
             std::span<const Light> lights,
             std::span<const std::uint32_t> area_lights,
             DisplacementSet& displacements,
             const SceneViews& views,
             RTCFilterFunctionN shadow_filter,
             std::shared_ptr<KeptTrees> trees)
    : shadow_filter_(shadow_filter),
      displacements_(&displacements),
      views_(&views),
      instances_(scene.instances),
      trees_(trees != nullptr ? std::move(trees) : std::make_shared<KeptTrees>(false))
{
  for (std::size_t d = 0; d < displacements.size(); ++d) displacements.geometry(d).shadow_filter = nullptr;
  for (const Mesh& mesh : scene.meshes) {
    meshes_.emplace_back().mesh = {mesh.name,        &mesh.P,        {}, mesh.triangles, mesh.radius,
                                   mesh.are_ribbons, mesh.are_points};
    has_curves_ |= !mesh.radius.empty();
    for (const MeshStep& step : mesh.steps) meshes_.back().mesh.steps.push_back(&step.P);
  }
  for (const MovedMesh& moved : displacements.moved()) {
    const MeshView& mesh = views_->meshes[meshes_.size()];
    meshes_.emplace_back().mesh = {moved.name, &moved.P, {}, {mesh.triangles, mesh.num_triangles}, {}};
    for (const MovedShape& step : moved.steps) meshes_.back().mesh.steps.push_back(&step.P);
  }
  for (std::size_t i = 0; i < scene.instances.size(); ++i) {
    const Instance& instance = scene.instances[i];
    const Material& material = scene.materials[static_cast<std::size_t>(instance.material_index)];
    const bool lets_light_through = material.alpha_mode != AlphaMode::kOpaque;
    if (const int displaced = displacements.geometry_index(i); displaced >= 0) {
      if (lets_light_through)
        displacements.geometry(static_cast<std::size_t>(displaced)).shadow_filter = shadow_filter_;
      continue;
    }
    MeshUse& mesh = use_of(i);
    ++mesh.count;
    mesh.transparent |= lets_light_through;
    mesh.takes_time |= (views.instances[i].flags & (kMoves | kDeforms)) != 0;
  }
  const auto meets_border = [&](std::size_t i) {
    if (displacements.geometry_index(i) < 0) use_of(i).at_border = true;
  };
  for (std::size_t k = 0; k < scene.border_instances.size(); ++k) {
    meets_border(scene.num_placed() + k);
    for (const int side : scene.border_instances[k].sides) meets_border(static_cast<std::size_t>(side));
  }
  pair_triangles();
  build_displaced(displacements);
  place_instances(scene, lights, area_lights);
  build_tessellated(displacements);
  build_meshes();
  for (std::size_t i = 0; i < scene.instances.size(); ++i) {
    if (scene_->instances[i] != nullptr) scene_->instances[i]->scene = tree_of(i).get();
  }
  build_top(scene, lights, area_lights);
  top_ = scene_->top.get();
  kept_ = trees_->end_scene();
  if (scene_->far_lights != nullptr) {
    target_ = ray_target_make(scene_->target, scene_->near_lengths);
    far_lights_target_ = ray_target_make(scene_bounds(scene_->far_lights.get()));
  } else {
    target_ = ray_target_make(bounds(), scene_->near_lengths);
  }
}

Accel::~Accel()
{
  if (keeps_top() && scene_ != nullptr && scene_->top != nullptr) trees_->put(std::move(scene_));
}

/// Chooses where Embree has quadrilaterals. What is in place is all of one kind: Embree has a tree for each kind, and rays pass both.
void Accel::pair_triangles()
{
  std::size_t num_triangles = 0, num_pairs = 0;
  for (MeshUse& use : meshes_) {
    if (use.count == 0 || !use.mesh.radius.empty()) continue;
    use.pairs = triangle_pairs_make(*use.mesh.P, use.mesh.triangles);
    const std::size_t count = use.pairs.size();
    if (!use.has_tree()) {
      num_triangles += use.mesh.triangles.size();
      num_pairs += count;
    } else if (!pairs_pay(count, use.mesh.triangles.size())) {
      use.pairs = {};
    }
  }
  const bool in_place = pairs_pay(num_pairs, num_triangles);
  for (MeshUse& use : meshes_) {
    if (!use.has_tree() && !in_place) use.pairs = {};
    has_pairs_ |= !use.pairs.empty();
  }
}

void Accel::build_displaced(DisplacementSet& displacements)
{
  const TraversalTable& traversals = traversal_table_select();
  for (std::size_t d = 0; d < displacements.size(); ++d) {
    DisplacedUse& use = displaced_.emplace_back();
    if (const Tessellation* tessellation = displacements.tessellation(d)) {
      use.box = tessellation->bounds();
      continue;
    }
    use.tree = displacements.tree(d);
    if (use.tree == nullptr) {
      DisplacedGeometry& displaced = displacements.geometry(d);
      const auto start = std::chrono::steady_clock::now();
      const std::uint64_t bytes_before = trees_->bytes();
      use.tree = trees_->scene_make();
      attach(use.tree.get(), displaced_geometry_make(trees_->device(), displaced, traversals), 0, ~0u);
      commit(use.tree.get());
      displaced.scene = use.tree.get();
      const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - start;
      displacements.set_tree(d, use.tree, trees_->bytes() - bytes_before, seconds.count());
    }
    use.box = scene_bounds(use.tree.get());
  }
}

void Accel::build_tessellated(DisplacementSet& displacements)
{
  for (std::size_t d = 0; d < displacements.size(); ++d) {
    const Tessellation* const tessellation = displacements.tessellation(d);
    if (tessellation == nullptr) continue;
    DisplacedUse& use = displaced_[d];
    use.tree = trees_->own(tessellation_scene_make(trees_->device(), kRenderTessellation));
    RTCGeometry geometry = tessellation->geometry_make(trees_->device());
    rtcSetGeometryOccludedFilterFunction(geometry, displacements.geometry(d).shadow_filter);
    attach(use.tree.get(), geometry, 0, ~0u);
    attach_corners(use.tree.get(), use.box, use.pad, tessellation->geometry_type());
    commit(use.tree.get());
    displacements.geometry(d).scene = use.tree.get();
  }
}

/// Lengths of the scene from which rays are near where all meshes are part of its tree: Embree's tests of triangles and of boxes around
/// them are sure of what they meet from wherever. A ray that is moved is traced by itself, and twice where a lamp is far away: views of
/// an object alone took a fifth longer by that.
constexpr float kNearLengths = 16.0f;

/// Prepares what stands in the scene as an instance, and finds how much boxes have to be enlarged.
void Accel::place_instances(const Scene& scene,
                            std::span<const Light> lights,
                            std::span<const std::uint32_t> area_lights)
{
  for (MeshUse& use : meshes_) {
    if (!use.has_tree()) continue;
    use.box = mesh_box(use.mesh, *use.mesh.P);
    for (const std::vector<Vec3f>* P : use.mesh.steps) use.box = box_union(use.box, mesh_box(use.mesh, *P));
  }
  scene_ = std::make_unique<SceneTree>();
  scene_->near_lengths = kNearLengths;
  Box3 box = box_empty();
  scene_->instances.resize(scene.instances.size());
  for (std::size_t i = 0; i < scene.instances.size(); ++i) {
    const Instance& instance = scene.instances[i];
    const MeshUse& use = use_of(i);
    const int displaced = displacements_->geometry_index(i);
    const auto d = static_cast<std::size_t>(displaced);
    if (displaced < 0 && !use.has_tree()) {
      box = box_union(box, points_box(*use.mesh.P, instance.world_from_object));
      continue;
    }
    // Boxes are padded for rays from one length away.
    scene_->near_lengths = 1.0f;
    // Trees of meshes and tessellations come later: their boxes depend on the pad.
    scene_->instances[i] = std::make_unique<InstanceGeometry>(instance_geometry_prepare(
        displaced >= 0 ? displaced_[d].tree.get() : nullptr, displaced >= 0 ? displaced_[d].box : use.box,
        instance.world_from_object, views_->motion.view(instance.motion_index), &scene_->pad));
    box = box_union(box, instance_bounds(*scene_->instances[i]));
  }
  const Box3 things = box;
  for (const std::uint32_t index : area_lights) {
    const Box3 light = light_box(lights[index]);
    if (!is_far_away(light, things)) box = box_union(box, light);
  }
  scene_->target = box;
  if (box.low.x <= box.high.x) scene_->pad = power_of_two_above(ray_target_pad(ray_target_make(box)));

  // The boxes of Embree's own instances are as large as those of what they show.
  for (std::size_t i = 0; i < scene.instances.size(); ++i) {
    std::unique_ptr<InstanceGeometry>& instance = scene_->instances[i];
    if (instance == nullptr || instance->scene != nullptr || instance->motion.num_keys > 0 ||
        !instance_is_accurate_in_single_precision(*instance)) {
      continue;
    }
    const int displaced = displacements_->geometry_index(i);
    Vec3f& pad = displaced >= 0 ? displaced_[static_cast<std::size_t>(displaced)].pad : use_of(i).pad;
    pad = max(pad, splat3(steady_pad(*instance)));
    instance.reset();
  }
}

void Accel::build_meshes()
{
  for (MeshUse& use : meshes_) {
    if (!use.has_tree()) continue;
    ContentHash content;
    if (trees_->keeps()) {
      ContentHasher hash;
      hash_triangles(use.mesh, &hash);
      hash.add(use.transparent, use.pad.x, use.pad.y, use.pad.z);
      content = hash.result();
    }
    use.tree = trees_->mesh_tree(content, [&] {
      TreePointer tree = trees_->scene_make();
      attach(tree.get(), use.mesh.radius.empty() ? new_mesh(use, nullptr) : new_curves(use.mesh, use.transparent), 0,
             ~0u);
      attach_corners(tree.get(), use.box, use.pad,
                     use.pairs.empty() ? RTC_GEOMETRY_TYPE_TRIANGLE : RTC_GEOMETRY_TYPE_QUAD);
      commit(tree.get());
      return tree;
    });
  }
}

const TreePointer& Accel::tree_of(std::size_t instance) const
{
  const int displaced = displacements_->geometry_index(instance);
  return displaced >= 0 ? displaced_[static_cast<std::size_t>(displaced)].tree : use_of(instance).tree;
}

/// All that build_top reads. Trees of parts are known by their places: a tree that is kept holds its parts.
ContentHash Accel::top_content(const Scene& scene,
                               std::span<const Light> lights,
                               std::span<const std::uint32_t> area_lights) const
{
  ContentHasher hash;
  hash.add(scene.instances.size(), area_lights.size(), scene_->pad);
  for (std::size_t i = 0; i < scene.instances.size(); ++i) {
    const Instance& instance = scene.instances[i];
    const MeshUse& use = use_of(i);
    const TreePointer& tree = tree_of(i);
    if (tree == nullptr) hash_triangles(use.mesh, &hash);
    hash.add(tree == nullptr, use.transparent, tree.get(), mask_of(instance.flags));
    hash_transform(instance.world_from_object, &hash);
  }
  for (const std::uint32_t index : area_lights) {
    const Light& light = lights[index];
    hash.add(light.kind, light.visible_to_camera, light.multiple_importance, light.radius);
    for (const Vec3f v : {light.P, light.edge_u, light.edge_v}) hash.add(v.x, v.y, v.z);
  }
  return hash.result();
}

void Accel::build_top(const Scene& scene, std::span<const Light> lights, std::span<const std::uint32_t> area_lights)
{
  if (keeps_top()) {
    scene_->content = top_content(scene, lights, area_lights);
    if (std::unique_ptr<SceneTree> kept = trees_->take(scene_->content)) {
      scene_ = std::move(kept);
      return;
    }
  }
  const auto start = std::chrono::steady_clock::now();
  const std::uint64_t bytes_before = trees_->bytes();
  for (const MeshUse& mesh : meshes_) {
    if (mesh.tree != nullptr) scene_->parts.push_back(mesh.tree);
  }
  for (const DisplacedUse& use : displaced_) scene_->parts.push_back(use.tree);
  const TreePointer top = trees_->scene_make();
  for (std::size_t i = 0; i < scene.instances.size(); ++i) {
    const Instance& instance = scene.instances[i];
    const MeshUse& use = use_of(i);
    const TreePointer& tree = tree_of(i);
    scene_->num_in_place += tree == nullptr ? 1 : 0;
    attach(top.get(),
           scene_->instances[i] != nullptr ? instance_geometry_make(trees_->device(), *scene_->instances[i])
           : tree != nullptr               ? new_instance(tree.get(), instance.world_from_object)
                                           : new_mesh(use, &instance.world_from_object),
           static_cast<unsigned>(i), mask_of(instance.flags));
  }
  for (std::size_t i = 0; i < area_lights.size(); ++i) {
    const Light& light = lights[area_lights[i]];
    RTCGeometry geometry = light_is_quad(light) && light.motion_index < 0 ? new_rectangle(light) : new_light(light);
    const auto id = static_cast<unsigned>(scene.instances.size() + i);
    const std::uint32_t seen = (light.multiple_importance ? std::uint32_t{kRayBounce} : 0u) |
                               (light.visible_to_camera ? std::uint32_t{kRayCamera} : 0u);
    const std::uint32_t mask = seen | seen << kRayCatchersShift;
    const Box3 with_light = box_union(scene_->target, light_box(light));
    if (with_light.low != scene_->target.low || with_light.high != scene_->target.high) {
      if (scene_->far_lights == nullptr) scene_->far_lights = trees_->scene_make();
      rtcRetainGeometry(geometry);
      attach(scene_->far_lights.get(), geometry, id, mask);
    }
    attach(top.get(), geometry, id, mask);
  }
  if (scene_->far_lights != nullptr) commit(scene_->far_lights.get());
  commit(top.get());
  scene_->top = top;
  scene_->bytes = trees_->bytes() - bytes_before;
  scene_->seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

/// Nearest hit of a ray that is moved near to a target.
/// @param nearest  ray's t of what is known; from afar single precision does not tell it from what is behind. Lowered where
///                 something nearer is hit
void Accel::intersect_far(const RayTarget& target,
                          RTCScene scene,
                          EmbreeContext& context,
                          RTCRayHit& ray,
                          double* nearest)
{
  RTCRayHit near = ray;
  near.hit.geomID = RTC_INVALID_GEOMETRY_ID;
  const FarRay far(target, context, &near.ray);
  if (!far.meets()) return;
  embree_intersect1(scene, context, near);
  if (near.hit.geomID == RTC_INVALID_GEOMETRY_ID || far.t(near.ray.tfar) >= *nearest) return;
  *nearest = far.t(near.ray.tfar);
  ray.hit = near.hit;
}

void Accel::trace(EmbreeContext& context, RTCRayHit& ray) const
{
  const RayStart start = ray_start(target_, ray.ray);
  if (start == RayStart::kNear) return embree_intersect1(top_, context, ray);
  if (start == RayStart::kInvalid) return;
  double nearest = HUGE_VAL;
  // On its way to where it is moved to there may be lights.
  if (RTCScene lights = scene_->far_lights.get()) {
    if (ray_start(far_lights_target_, ray.ray) == RayStart::kNear) {
      embree_intersect1(lights, context, ray);
      if (ray.hit.geomID != RTC_INVALID_GEOMETRY_ID) nearest = static_cast<double>(ray.ray.tfar);
    } else {
      intersect_far(far_lights_target_, lights, context, ray, &nearest);
    }
  }
  intersect_far(target_, top_, context, ray, &nearest);
  ray.ray.tfar = static_cast<float>(min(static_cast<double>(ray.ray.tfar), nearest));
}

void Accel::to_triangle(unsigned object, std::uint32_t* primitive, float* u, float* v) const
{
  if (object >= views_->instances.size() || (views_->instances[object].flags & kDisplaced) != 0) return;
  const MeshUse& use = use_of(object);
  if (use.pairs.empty()) return;
  const TrianglePlace place = pair_place(use.pairs[*primitive], *u, *v);
  *primitive = place.triangle;
  *u = place.u;
  *v = place.v;
}

void Accel::intersect(EmbreeContext& context, RTCRayHit& ray) const
{
  trace(context, ray);
  if (!has_pairs_ || ray.hit.geomID == RTC_INVALID_GEOMETRY_ID) return;
  const unsigned object = met_object(ray);
  to_triangle(object, &ray.hit.primID, &ray.hit.u, &ray.hit.v);
}

/// Context of a query that meets only what is wanted: Embree's part first.
struct Accel::SelectingContext {
  EmbreeContext embree;
  Wanted wanted;
};

/// Hits on what is not wanted do not count: something wanted may lie at the same distance.
void Accel::selecting_filter(const RTCFilterFunctionNArguments* arguments)
{
  const Wanted& wanted = reinterpret_cast<const SelectingContext*>(arguments->context)->wanted;
  for (unsigned i = 0; i < arguments->N; ++i) {
    if (arguments->valid[i] != -1) continue;
    RTCRayHit met;
    met.hit = rtcGetHitFromHitN(arguments->hit, arguments->N, i);
    if (!wanted.asks(wanted.asked, met_object(met))) arguments->valid[i] = 0;
  }
}

unsigned Accel::intersect_wanted(const EmbreeContext& context, RTCRayHit& ray, const Wanted& wanted) const
{
  SelectingContext selecting{context, wanted};
  embree_context_filter(selecting.embree, selecting_filter);
  const float t_max = ray.ray.tfar;
  for (;;) {
    ray.ray.tfar = t_max;
    ray.hit.geomID = ray.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
    intersect(selecting.embree, ray);
    const unsigned object = met_object(ray);
    if (object == RTC_INVALID_GEOMETRY_ID || wanted.asks(wanted.asked, object)) return object;
    // Displaced geometry asks no filter. Embree would give the same hit again: a ray that starts at one meets it.
    ray.ray.tnear = t_min_behind(ray.ray.tfar);
  }
}

namespace {

/// Context of a query that gathers hits: Embree's part first.
struct GatheringContext {
  EmbreeContext embree;
  const Accel* accel = nullptr;
  unsigned instance = 0;
  std::span<RTCRayHit> hits;
  std::size_t num_hits = 0;
};

/// No hit counts, so that the search goes on.
void gathering_filter(const RTCFilterFunctionNArguments* arguments)
{
  auto& context = *reinterpret_cast<GatheringContext*>(arguments->context);
  for (unsigned i = 0; i < arguments->N; ++i) {
    if (arguments->valid[i] != -1) continue;
    arguments->valid[i] = 0;
    RTCRayHit met;
    met.hit = rtcGetHitFromHitN(arguments->hit, arguments->N, i);
    if (context.num_hits == context.hits.size() ||
        !context.accel->are_of_one_object(met_object(met), context.instance)) {
      continue;
    }
    const auto t = static_cast<double>(RTCRayN_tfar(arguments->ray, arguments->N, i));
    const ObjectRay* inside = context.embree.object_ray;
    met.ray.tfar = static_cast<float>(inside == nullptr ? t : inside->t_start + inside->t_scale * t);
    context.hits[context.num_hits++] = met;
  }
}

}  // namespace

std::size_t Accel::gather_hits(unsigned instance, const RTCRayHit& ray, std::span<RTCRayHit> hits) const
{
  std::size_t num_hits = 0;
  RTCRayHit search = ray;
  if (!displaced_.empty() || ray_start(target_, ray.ray) != RayStart::kNear) {
    // Displaced geometry asks no filter, and may be nearer than what has been gathered.
    EmbreeContext context;
    embree_context_init(context, false);
    const auto is_wanted = [&](unsigned met) { return are_of_one_object(met, instance); };
    while (num_hits < hits.size() && intersect_only(context, search, is_wanted) != RTC_INVALID_GEOMETRY_ID) {
      hits[num_hits++] = search;
      search.ray.tnear = t_min_behind(search.ray.tfar);
      search.ray.tfar = ray.ray.tfar;
    }
    return num_hits;
  }
  GatheringContext context{{}, this, instance, hits};
  embree_context_init(context.embree, false);
  embree_context_filter(context.embree, gathering_filter);
  search.hit.geomID = search.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
  embree_intersect1(top_, context.embree, search);
  for (RTCRayHit& met : hits.first(context.num_hits)) {
    const float t = met.ray.tfar;
    met.ray = ray.ray;
    met.ray.tfar = t;
    if (has_pairs_) to_triangle(met_object(met), &met.hit.primID, &met.hit.u, &met.hit.v);
  }
  return context.num_hits;
}

void Accel::intersect8(EmbreeContext& context, RTCRayHit8& rays) const
{
  alignas(32) int valid[8];
  bool any = false;
  for (unsigned i = 0; i < 8; ++i) {
    const RTCRay8& r = rays.ray;
    const RayStart start = ray_start(target_, {r.org_x[i], r.org_y[i], r.org_z[i]},
                                     {r.dir_x[i], r.dir_y[i], r.dir_z[i]}, r.tnear[i], r.tfar[i]);
    valid[i] = start == RayStart::kNear ? -1 : 0;
    any |= valid[i] != 0;
    if (start != RayStart::kFar) continue;
    RTCRayHit ray = rtcGetRayHitFromRayHitN(reinterpret_cast<RTCRayHitN*>(&rays), 8, i);
    intersect(context, ray);
    rtcCopyHitToHitN(RTCRayHitN_HitN(reinterpret_cast<RTCRayHitN*>(&rays), 8), &ray.hit, 8, i);
    rays.ray.tfar[i] = ray.ray.tfar;
  }
  if (!any) return;
  embree_intersect8(valid, top_, context, rays);
  if (!has_pairs_) return;
  for (unsigned i = 0; i < 8; ++i) {
    if (valid[i] == 0 || rays.hit.geomID[i] == RTC_INVALID_GEOMETRY_ID) continue;
    const unsigned instance = rays.hit.instID[0][i];
    to_triangle(instance != RTC_INVALID_GEOMETRY_ID ? instance : rays.hit.geomID[i], &rays.hit.primID[i],
                &rays.hit.u[i], &rays.hit.v[i]);
  }
}

void Accel::occluded(EmbreeContext& context, RTCRay& ray) const
{
  const RayStart start = ray_start(target_, ray);
  if (start == RayStart::kNear) return embree_occluded1(top_, context, ray);
  if (start == RayStart::kInvalid) return;
  RTCRay near = ray;
  const FarRay far(target_, context, &near);
  if (!far.meets()) return;
  embree_occluded1(top_, context, near);
  if (near.tfar < 0.0f) ray.tfar = near.tfar;
}

Box3 Accel::bounds() const { return scene_bounds(top_); }

/// Triangles, or quadrilaterals of them.
void Accel::set_corners(RTCGeometry geometry, const MeshUse& use)
{
  const std::span<const TriangleIndices> triangles = use.mesh.triangles;
  if (use.pairs.empty() && !trees_->keeps()) {
    rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, triangles.data(), 0,
                               sizeof(TriangleIndices), triangles.size());
    return;
  }
  const bool pairs = !use.pairs.empty();
  const std::size_t count = pairs ? use.pairs.size() : triangles.size(), sides = pairs ? 4 : 3;
  auto* const corners = static_cast<std::uint32_t*>(rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0,
                                                                            pairs ? RTC_FORMAT_UINT4 : RTC_FORMAT_UINT3,
                                                                            sides * sizeof(std::uint32_t), count));
  if (corners == nullptr) throw OutOfMemory("the triangles of mesh '" + std::string(use.mesh.name) + "'");
  if (!pairs) {
    std::memcpy(corners, triangles.data(), triangles.size() * sizeof(TriangleIndices));
    return;
  }
  for (std::size_t k = 0; k < count; ++k) pair_corners(use.pairs[k], triangles, corners + 4 * k);
}

RTCGeometry Accel::new_mesh(const MeshUse& use, const Affine3* world_from_object)
{
  const TreeMesh& mesh = use.mesh;
  RTCGeometry geometry =
      rtcNewGeometry(trees_->device(), use.pairs.empty() ? RTC_GEOMETRY_TYPE_TRIANGLE : RTC_GEOMETRY_TYPE_QUAD);
  const bool in_place = world_from_object == nullptr || is_identity(*world_from_object);
  const auto set_vertices = [&](unsigned step, const std::vector<Vec3f>& P) {
    // Embree reads 16 bytes a vertex, so a shared buffer needs room behind its last one.
    if (in_place && !trees_->keeps() && P.capacity() > P.size()) {
      rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, step, RTC_FORMAT_FLOAT3, P.data(), 0, sizeof(Vec3f),
                                 P.size());
      return;
    }
    auto* vertices = static_cast<Vec3f*>(
        rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, step, RTC_FORMAT_FLOAT3, sizeof(Vec3f), P.size()));
    if (vertices == nullptr) throw OutOfMemory("the vertices of mesh '" + std::string(mesh.name) + "'");
    for (std::size_t i = 0; i < P.size(); ++i) {
      vertices[i] = in_place ? P[i] : transform_point(*world_from_object, P[i]);
    }
  };
  if (mesh.steps.empty()) {
    set_vertices(0, *mesh.P);
  } else {
    rtcSetGeometryTimeStepCount(geometry, static_cast<unsigned>(mesh.steps.size()));
    for (std::size_t step = 0; step < mesh.steps.size(); ++step) {
      set_vertices(static_cast<unsigned>(step), *mesh.steps[step]);
    }
  }
  set_corners(geometry, use);
  if (use.transparent) rtcSetGeometryOccludedFilterFunction(geometry, shadow_filter_);
  return geometry;
}

/// Lets rays pass what they do not meet of curves. The geometry's user data are its indices, of the vertex before each segment.
template <bool kTubes>
void curve_filter(const RTCFilterFunctionNArguments* arguments)
{
  const auto* before = static_cast<const std::uint32_t*>(arguments->geometryUserPtr);
  for (unsigned i = 0; i < arguments->N; ++i) {
    if (arguments->valid[i] != -1) continue;
    const auto name_of = [before](unsigned instance, unsigned segment) {
      return curve_name(instance, segment, before[segment] + 1);
    };
    if (!curve_is_met(arguments, i, name_of, kTubes)) arguments->valid[i] = 0;
  }
}

/// The same of points.
void point_filter(const RTCFilterFunctionNArguments* arguments)
{
  const auto name_of = [](unsigned instance, unsigned point) { return curve_name(instance, point, kPoints, nullptr); };
  for (unsigned i = 0; i < arguments->N; ++i) {
    if (arguments->valid[i] == -1 && !curve_is_met(arguments, i, name_of, true)) arguments->valid[i] = 0;
  }
}

/// Vertices with their radii.
void Accel::set_round_vertices(RTCGeometry geometry, const TreeMesh& mesh)
{
  const auto set = [&](unsigned step, const std::vector<Vec3f>& P) {
    auto* vertices = static_cast<Vec4f*>(
        rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, step, RTC_FORMAT_FLOAT4, sizeof(Vec4f), P.size()));
    if (vertices == nullptr) throw OutOfMemory("the curves of mesh '" + std::string(mesh.name) + "'");
    for (std::size_t i = 0; i < P.size(); ++i) vertices[i] = {P[i].x, P[i].y, P[i].z, mesh.radius[i]};
  };
  if (mesh.steps.empty()) {
    set(0, *mesh.P);
    return;
  }
  rtcSetGeometryTimeStepCount(geometry, static_cast<unsigned>(mesh.steps.size()));
  for (std::size_t step = 0; step < mesh.steps.size(); ++step) set(static_cast<unsigned>(step), *mesh.steps[step]);
}

RTCGeometry Accel::new_curves(const TreeMesh& mesh, bool transparent)
{
  if (mesh.are_points) {
    RTCGeometry points = rtcNewGeometry(trees_->device(), RTC_GEOMETRY_TYPE_SPHERE_POINT);
    set_round_vertices(points, mesh);
    rtcSetGeometryIntersectFilterFunction(points, point_filter);
    rtcSetGeometryOccludedFilterFunction(points, transparent ? shadow_filter_ : point_filter);
    return points;
  }
  RTCGeometry geometry = rtcNewGeometry(trees_->device(), mesh.are_ribbons ? RTC_GEOMETRY_TYPE_FLAT_CATMULL_ROM_CURVE
                                                                           : RTC_GEOMETRY_TYPE_ROUND_CATMULL_ROM_CURVE);
  set_round_vertices(geometry, mesh);
  auto* first = static_cast<std::uint32_t*>(rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT,
                                                                    sizeof(std::uint32_t), mesh.triangles.size()));
  if (first == nullptr) throw OutOfMemory("the curves of mesh '" + std::string(mesh.name) + "'");
  for (std::size_t i = 0; i < mesh.triangles.size(); ++i) first[i] = mesh.triangles[i].v0 - 1;
  rtcSetGeometryUserData(geometry, first);
  const RTCFilterFunctionN filter = mesh.are_ribbons ? curve_filter<false> : curve_filter<true>;
  rtcSetGeometryIntersectFilterFunction(geometry, filter);
  rtcSetGeometryOccludedFilterFunction(geometry, transparent ? shadow_filter_ : filter);
  return geometry;
}

/// Enlarges a scene's box, by two points that no ray hits.
/// @param type  of what else is in the scene, triangles, quadrilaterals or grids: Embree has a tree for each type, and rays pass all
void Accel::attach_corners(RTCScene target, const Box3& box, Vec3f pad, RTCGeometryType type)
{
  if (is_zero(pad)) return;
  RTCGeometry geometry = rtcNewGeometry(trees_->device(), type);
  const auto new_buffer = [&](RTCBufferType buffer, RTCFormat format, std::size_t bytes, std::size_t count) {
    void* const made = rtcSetNewGeometryBuffer(geometry, buffer, 0, format, bytes, count);
    if (made == nullptr) throw OutOfMemory("the box of a mesh");
    return made;
  };
  const Vec3f corners[2] = {box.low - pad, box.high + pad};
  // A grid has four vertices at least.
  const std::uint32_t sides = type == RTC_GEOMETRY_TYPE_TRIANGLE ? 3 : 4;
  const bool is_grid = type == RTC_GEOMETRY_TYPE_GRID;
  const std::uint32_t copies = is_grid ? sides : 1;
  auto* const vertices =
      static_cast<Vec3f*>(new_buffer(RTC_BUFFER_TYPE_VERTEX, RTC_FORMAT_FLOAT3, sizeof(Vec3f), 2 * copies));
  for (std::uint32_t i = 0; i < 2 * copies; ++i) vertices[i] = corners[i / copies];
  if (is_grid) {
    auto* const grids = static_cast<RTCGrid*>(new_buffer(RTC_BUFFER_TYPE_GRID, RTC_FORMAT_GRID, sizeof(RTCGrid), 2));
    for (std::uint32_t i = 0; i < 2; ++i) grids[i] = {i * sides, 2, 2, 2};
  } else {
    auto* const indices = static_cast<std::uint32_t*>(new_buffer(
        RTC_BUFFER_TYPE_INDEX, sides == 4 ? RTC_FORMAT_UINT4 : RTC_FORMAT_UINT3, sides * sizeof(std::uint32_t), 2));
    for (std::uint32_t i = 0; i < 2 * sides; ++i) indices[i] = i / sides;
  }
  attach(target, geometry, 1, 0);
}

RTCGeometry Accel::new_instance(RTCScene instanced, const Affine3& m)
{
  RTCGeometry geometry = rtcNewGeometry(trees_->device(), RTC_GEOMETRY_TYPE_INSTANCE);
  rtcSetGeometryInstancedScene(geometry, instanced);
  const float columns[12] = {m.x.x, m.x.y, m.x.z, m.y.x, m.y.y, m.y.z, m.z.x, m.z.y, m.z.z, m.p.x, m.p.y, m.p.z};
  rtcSetGeometryTransform(geometry, 0, RTC_FORMAT_FLOAT3X4_COLUMN_MAJOR, columns);
  return geometry;
}

Box3 Accel::light_box(const Light& light) const
{
  if (light.motion_index >= 0) return light_geometry_bounds(light_geometry_prepare(light, views_->motion.views()));
  const Vec3f half = light_half_extent(light);
  return {light.P - half, light.P + half};
}

RTCGeometry Accel::new_rectangle(const Light& light)
{
  RTCGeometry geometry = rtcNewGeometry(trees_->device(), RTC_GEOMETRY_TYPE_QUAD);
  auto* vertices = static_cast<Vec3f*>(
      rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, sizeof(Vec3f), 4));
  auto* indices = static_cast<std::uint32_t*>(
      rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT4, 4 * sizeof(std::uint32_t), 1));
  if (vertices == nullptr || indices == nullptr) throw OutOfMemory("an area light");
  vertices[0] = light.P - light.edge_u - light.edge_v;
  vertices[1] = light.P + light.edge_u - light.edge_v;
  vertices[2] = light.P + light.edge_u + light.edge_v;
  vertices[3] = light.P - light.edge_u + light.edge_v;
  for (std::uint32_t i = 0; i < 4; ++i) indices[i] = i;
  return geometry;
}

RTCGeometry Accel::new_light(const Light& light)
{
  const MotionView* const motions = light.motion_index >= 0 ? views_->motion.views() : nullptr;
  scene_->lights.push_back(std::make_unique<LightGeometry>(light_geometry_prepare(light, motions)));
  return light_geometry_make(trees_->device(), *scene_->lights.back());
}

void Accel::attach(RTCScene target, RTCGeometry geometry, unsigned id, std::uint32_t mask)
{
  rtcSetGeometryMask(geometry, mask);
  rtcCommitGeometry(geometry);
  rtcAttachGeometryByID(target, geometry, id);
  rtcReleaseGeometry(geometry);
}

void Accel::commit(RTCScene target)
{
  rtcCommitScene(target);
  const RTCError error = rtcGetDeviceError(trees_->device());
  if (const std::optional<OutOfMemory> refusal = trees_->refusal()) throw *refusal;
  if (error == RTC_ERROR_NONE) return;
  // What the standard library throws is unknown to Embree: that no thread can be started, where there is little memory.
  if (error == RTC_ERROR_OUT_OF_MEMORY || error == RTC_ERROR_UNKNOWN) throw OutOfMemory("the acceleration structure");
  throw std::runtime_error("Embree failed to build the acceleration structure (error " +
                           std::to_string(static_cast<int>(error)) + ")");
}

}  // namespace relief
