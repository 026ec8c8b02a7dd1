#include "integrator/computed_heights.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <map>
#include <tuple>

#include "displacement/seen_instances.h"
#include "displacement/vec3d.h"
#include "integrator/graph_bounds_stage.h"
#include "integrator/scene_views.h"
#include "integrator/stages.h"
#include "kernel/graph/graph_material.h"
#include "scene/texture_store.h"

namespace relief {

namespace {

/// Whether a quantity is linear in the weights of a triangle's vertices.
bool is_linear(GraphQuantity q)
{
  using Q = GraphQuantity;
  switch (q) {
    case Q::normal_x:
    case Q::normal_y:
    case Q::normal_z:
    case Q::true_normal_x:
    case Q::true_normal_y:
    case Q::true_normal_z:
    case Q::incoming_x:
    case Q::incoming_y:
    case Q::incoming_z:
    case Q::object_normal_x:
    case Q::object_normal_y:
    case Q::object_normal_z:
    case Q::window_x:
    case Q::window_y:
    case Q::edge_distance:
    case Q::tangent_normal_x:
    case Q::tangent_normal_y:
    case Q::tangent_normal_z:
    case Q::parametric_x:
    case Q::parametric_y:
      return false;
    default:
      return true;
  }
}

/// Whether a quantity differs between instances of a mesh.
bool is_of_instance(GraphQuantity q, const MeshView& mesh, std::uint16_t index)
{
  using Q = GraphQuantity;
  switch (q) {
    case Q::object_x:
    case Q::object_y:
    case Q::object_z:
    case Q::generated_x:
    case Q::generated_y:
    case Q::generated_z:
    case Q::uv0_u:
    case Q::uv0_v:
    case Q::uv1_u:
    case Q::uv1_v:
    case Q::uv0_width:
    case Q::uv1_width:
    case Q::color_r:
    case Q::color_g:
    case Q::color_b:
    case Q::color_a:
    case Q::backfacing:
    case Q::object_normal_x:
    case Q::object_normal_y:
    case Q::object_normal_z:
    case Q::vertex_normal_x:
    case Q::vertex_normal_y:
    case Q::vertex_normal_z:
    case Q::smooth_normal_x:
    case Q::smooth_normal_y:
    case Q::smooth_normal_z:
    case Q::parametric_x:
    case Q::parametric_y:
      return false;
    case Q::attribute_value:
    case Q::attribute_x:
    case Q::attribute_y:
    case Q::attribute_z:
    case Q::attribute_alpha:
      return std::none_of(mesh.columns, mesh.columns + mesh.num_columns,
                          [=](const MeshColumn& column) { return column.name == index; });
    default:
      return true;
  }
}

/// Whether a quantity is the same at all points of an instance.
bool is_of_all(GraphQuantity q, const MeshView& mesh, std::uint16_t index)
{
  using Q = GraphQuantity;
  switch (q) {
    case Q::attribute_value:
    case Q::attribute_x:
    case Q::attribute_y:
    case Q::attribute_z:
    case Q::attribute_alpha:
      return is_of_instance(q, mesh, index);
    case Q::world_from_object:
    case Q::object_from_world:
    case Q::camera_from_world:
    case Q::world_from_camera:
    case Q::instance:
    case Q::shutter_time:
      return true;
    default:
      return false;
  }
}

/// The places of a triangle's vertices by their positions, so that triangles of a side have its ends in the same order.
std::array<int, 3> vertex_order(const MeshView& mesh, std::uint32_t triangle)
{
  const TriangleIndices& v = mesh.triangles[triangle];
  const Vec3f P[3] = {mesh.P[v.v0], mesh.P[v.v1], mesh.P[v.v2]};
  std::array<int, 3> order = {0, 1, 2};
  std::stable_sort(order.begin(), order.end(),
                   [&](int a, int b) { return std::tie(P[a].x, P[a].y, P[a].z) < std::tie(P[b].x, P[b].y, P[b].z); });
  return order;
}

/// A graph over one mesh, or over one instance of it.
struct GraphHeights {
  const MeshView* mesh;
  InstanceView instance;  ///< without a place of its own where the graph reads of the mesh alone
  GraphProgramView program;
  const TextureView* textures;
  const ImageBounds* image_bounds;
  GraphRun run;
  GraphBoundsRun run_bounds;
  GraphScene scene;
  std::uint64_t id;  ///< of all that ever were
};

/// What a graph reads of one triangle.
class OnTriangle {
 public:
  OnTriangle(const GraphHeights& heights, std::uint32_t triangle)
      : heights_(heights), order_(vertex_order(*heights.mesh, triangle)), mesh_(*heights.mesh)
  {
    const TriangleIndices& v = mesh_.triangles[triangle];
    const std::uint32_t vertices[3] = {v.v0, v.v1, v.v2};
    sorted_ = {vertices[order_[0]], vertices[order_[1]], vertices[order_[2]]};
    mesh_.triangles = &sorted_;
    mesh_.num_triangles = 1;
  }

  const std::array<int, 3>& order() const { return order_; }
  /// Place of a vertex in that order.
  int place_of(int vertex) const
  {
    return static_cast<int>(std::find(order_.begin(), order_.end(), vertex) - order_.begin());
  }
  /// A point's hit, which the result points to.
  /// @param w  weights of the vertices in their order here
  GraphPoint point(const float* w, SurfaceHit& hit) const
  {
    hit = surface_hit_make(mesh_, heights_.instance, 0, w[1], w[2]);
    // Triangles of a side have normals of their own, and these point to where their vertices are in order.
    if (mesh_.N == nullptr && is_turned()) hit.Ns = -hit.Ns;
    hit.Ng = hit.Ns;
    GraphPoint out{{&mesh_, 0, w[1], w[2]}, &heights_.instance, &hit, hit.Ns, {0, 0}, 0.0f, &heights_.scene, {}};
    out.P_object = transform_point(heights_.instance.object_from_world, hit.P);
    return out;
  }
  float quantity(const GraphInput& input, const GraphPoint& at, const float* w) const
  {
    if (input.quantity == GraphQuantity::parametric_x) return w[place_of(0)];
    if (input.quantity == GraphQuantity::parametric_y) return w[place_of(1)];
    return graph_quantity(at, input.quantity, input.index);
  }
  float quantity(const GraphInput& input, const float* w) const
  {
    SurfaceHit hit;
    return quantity(input, point(w, hit), w);
  }

 private:
  bool is_turned() const { return (order_[1] - order_[0] + 3) % 3 != 1; }

  const GraphHeights& heights_;
  std::array<int, 3> order_;
  MeshView mesh_;
  TriangleIndices sorted_;
};

/// The linear quantities of the triangle that a thread asked for last.
struct TriangleInputs {
  std::uint64_t id = 0;
  std::uint32_t triangle = 0;
  std::array<int, 3> order{};
  std::vector<std::array<float, 3>> values;  ///< of each input, at the vertices in their order
};

const TriangleInputs& triangle_inputs(const GraphHeights& heights, std::uint32_t triangle)
{
  thread_local TriangleInputs last;
  if (last.id == heights.id && last.triangle == triangle) return last;
  const OnTriangle on(heights, triangle);
  last.id = heights.id;
  last.triangle = triangle;
  last.order = on.order();
  last.values.resize(heights.program.num_inputs);
  for (std::uint32_t i = 0; i < heights.program.num_inputs; ++i) {
    const GraphInput& input = heights.program.inputs[i];
    if (!is_linear(input.quantity)) continue;
    for (std::size_t k = 0; k < 3; ++k) {
      float w[3] = {0, 0, 0};
      w[k] = 1;
      last.values[i][k] = on.quantity(input, w);
    }
  }
  return last;
}

/// One of the numbers that a graph has given.
F8 result_of(const GraphHeights& heights, const GraphRegisters& registers, std::size_t number)
{
  const std::uint16_t result = heights.program.results[number];
  return result == kNoGraphOperand ? F8{} : graph_operand(heights.program, registers, result);
}

/// Heights by a graph whose inputs are set.
void run(const GraphHeights& heights, GraphRegisters& registers, float* h)
{
  heights.run(heights.program, heights.textures, registers);
  const F8 out = result_of(heights, registers, 0);
  for (int lane = 0; lane < 8; ++lane) h[lane] = out[lane];
}

/// Vectors, likewise.
void run(const GraphHeights& heights, GraphRegisters& registers, Vec3f* moves)
{
  heights.run(heights.program, heights.textures, registers);
  const F8 out[3] = {result_of(heights, registers, 0), result_of(heights, registers, 1),
                     result_of(heights, registers, 2)};
  const auto finite = [](float x) { return std::isfinite(x) ? x : 0.0f; };
  for (int lane = 0; lane < 8; ++lane) moves[lane] = {finite(out[0][lane]), finite(out[1][lane]), finite(out[2][lane])};
}

/// @param out  heights or vectors
template <typename Out>
void eval(const void* owner, std::uint32_t triangle, const float (*b)[8], Out* out)
{
  const auto& heights = *static_cast<const GraphHeights*>(owner);
  const GraphProgramView& program = heights.program;
  const TriangleInputs& inputs = triangle_inputs(heights, triangle);
  F8 w[3];
  for (std::size_t k = 0; k < 3; ++k) w[k] = load8(b[inputs.order[k]]);
  GraphRegisters registers;
  for (std::uint32_t i = 0; i < program.num_inputs; ++i) {
    const GraphInput& input = program.inputs[i];
    F8& lanes = registers.lanes[input.register_index];
    if (is_linear(input.quantity)) {
      const std::array<float, 3>& v = inputs.values[i];
      // On a side one term is zero: the others are added in the same order by both of its triangles.
      lanes = w[0] * v[0] + w[1] * v[1] + w[2] * v[2];
      continue;
    }
    const OnTriangle on(heights, triangle);
    for (int lane = 0; lane < 8; ++lane) {
      const float at[3] = {w[0][lane], w[1][lane], w[2][lane]};
      lanes[lane] = on.quantity(input, at);
    }
  }
  run(heights, registers, out);
}

/// As CornerHeights, heights or vectors.
template <typename Out>
void eval_corners(const void* owner, const std::uint32_t* corners, Out* out)
{
  const auto& heights = *static_cast<const GraphHeights*>(owner);
  const GraphProgramView& program = heights.program;
  GraphRegisters registers;
  for (int lane = 0; lane < 8; ++lane) {
    const OnTriangle on(heights, corners[lane] / 3);
    float w[3] = {0, 0, 0};
    w[on.place_of(static_cast<int>(corners[lane] % 3))] = 1;
    SurfaceHit hit;
    const GraphPoint at = on.point(w, hit);
    for (std::uint32_t i = 0; i < program.num_inputs; ++i) {
      registers.lanes[program.inputs[i].register_index][lane] = on.quantity(program.inputs[i], at, w);
    }
  }
  run(heights, registers, out);
}

/// A number that is linear in the weights, over parallelograms.
/// @param at  its values at the triangle's vertices
GraphRange linear_range(const WeightPatches& patches, const float* at)
{
  const F8 b1 = load8(patches.center[0]), b2 = load8(patches.center[1]);
  const float e1 = at[1] - at[0], e2 = at[2] - at[0];
  const auto along = [=](const float(*d)[8]) { return load8(d[0]) * e1 + load8(d[1]) * e2; };
  // The sums of three products that stand for it elsewhere are off by their rounding.
  const float size = std::max({std::abs(at[0]), std::abs(at[1]), std::abs(at[2])});
  GraphRange out{at[0] + b1 * e1 + b2 * e2, along(patches.du),  along(patches.dv),
                 splat8(1e-6f * size),      splat8(-kInfinity), splat8(kInfinity)};
  return range_closed(out);
}

/// Bounds of what a graph reads that is not linear.
GraphRange other_range(const OnTriangle& on, const GraphInput& input, const WeightPatches& patches)
{
  using Q = GraphQuantity;
  const float first[3] = {1, 0, 0}, second[3] = {0, 1, 0};
  switch (input.quantity) {
    case Q::parametric_x:
      return linear_range(patches, first);
    case Q::parametric_y:
      return linear_range(patches, second);
    case Q::window_x:
    case Q::window_y:
    case Q::edge_distance:
    case Q::tangent_normal_x:
    case Q::tangent_normal_y:
    case Q::tangent_normal_z:
      return range_unknown();
    default:
      break;
  }
  // Unit vectors between those of the vertices, of which the quantities come by threes.
  constexpr Q kVectors[] = {Q::normal_x, Q::true_normal_x, Q::incoming_x, Q::object_normal_x};
  Q vector = kVectors[0];
  for (const Q each : kVectors) {
    if (input.quantity >= each) vector = std::max(vector, each);
  }
  GraphRange component[3];
  for (int axis = 0; axis < 3; ++axis) {
    GraphInput part = input;
    part.quantity = static_cast<Q>(static_cast<int>(vector) + axis);
    float at[3];
    for (int vertex = 0; vertex < 3; ++vertex) {
      float w[3] = {0, 0, 0};
      w[on.place_of(vertex)] = 1;
      at[vertex] = on.quantity(part, w);
    }
    component[axis] = linear_range(patches, at);
  }
  GraphRange squared = range_point(F8{});
  for (const GraphRange& c : component) squared = squared + range_within(c * c, F8{}, splat8(kInfinity));
  const F8 low = sqrt(max(squared.low, F8{})), high = sqrt(max(squared.high, F8{}));
  const GraphRange length = range_of_function(squared, sqrt(max(squared.c, F8{})), 0.5f / high, 0.5f / low, low, high);
  const int axis = static_cast<int>(input.quantity) - static_cast<int>(vector);
  return range_within(component[axis] * range_reciprocal(length), splat8(-1.00001f), splat8(1.00001f));
}

void bounds(const void* owner, std::uint32_t triangle, const WeightPatches& patches, float* low, float* high)
{
  const auto& heights = *static_cast<const GraphHeights*>(owner);
  const GraphProgramView& program = heights.program;
  const TriangleInputs& inputs = triangle_inputs(heights, triangle);
  const auto registers = std::make_unique_for_overwrite<GraphRangeRegisters>();
  for (std::uint32_t i = 0; i < program.num_inputs; ++i) {
    const GraphInput& input = program.inputs[i];
    GraphRange& lanes = registers->lanes[input.register_index];
    if (is_linear(input.quantity)) {
      float at[3];
      for (std::size_t k = 0; k < 3; ++k) at[inputs.order[k]] = inputs.values[i][k];
      lanes = linear_range(patches, at);
    } else {
      lanes = other_range(OnTriangle(heights, triangle), input, patches);
    }
  }
  registers->images = heights.image_bounds;
  heights.run_bounds(program, heights.textures, *registers);
  const std::uint16_t result = program.results[0];
  const GraphRange out =
      result == kNoGraphOperand ? range_point(F8{}) : graph_range_operand(program, *registers, result);
  store8(low, out.low);
  store8(high, out.high);
}

/// Owner of all heights of a scene.
struct SceneHeights {
  explicit SceneHeights(const Scene& scene) : views(scene) {}

  SceneViews views;
  std::vector<std::unique_ptr<GraphHeights>> heights;
};

}  // namespace

void computed_heights_add(const Scene& scene, const DisplacementOptions& options, DisplacementInput* input)
{
  static std::atomic<std::uint64_t> next_id{1};
  const auto settings_of = [&](const DisplacedInstance& instance) -> const DisplacementSettings* {
    if (instance.displacement_index < 0) return nullptr;
    const DisplacementSettings& settings = scene.displacements[static_cast<std::size_t>(instance.displacement_index)];
    return displacement_is_computed(settings) ? &settings : nullptr;
  };
  if (std::none_of(input->instances.begin(), input->instances.end(), settings_of)) return;
  const auto all = std::make_shared<SceneHeights>(scene);
  input->heights_owner = all;
  input->meshes = all->views.meshes;  // with the attributes that graphs read
  const Camera camera = options.camera.value_or(scene.cameras.front().camera);
  const auto picture_height = static_cast<double>(options.camera ? options.picture_height : scene.render.height);
  GraphScene graph_scene;
  graph_scene.columns = all->views.instance_columns.data();
  graph_scene.num_columns = static_cast<std::uint32_t>(all->views.instance_columns.size());
  graph_scene.camera = camera;
  graph_scene.camera.world_from_camera = camera_graph_frame(camera);
  graph_scene.camera_from_world = inverse(graph_scene.camera.world_from_camera);
  std::map<std::tuple<int, int, int>, int> known;  // mesh, displacement, instance where that matters
  struct Place {
    const MeshView* mesh;
    std::vector<Affine3> instances;
    const DisplacementSettings* settings;
  };
  std::vector<Place> places;  // of each of the heights
  for (std::size_t i = 0; i < input->instances.size(); ++i) {
    DisplacedInstance& instance = input->instances[i];
    const DisplacementSettings* settings = settings_of(instance);
    if (settings == nullptr) continue;
    const MeshView& mesh = all->views.meshes[static_cast<std::size_t>(instance.mesh_index)];
    const bool has_graph = settings->graph_index >= 0;
    const GraphProgramView program =
        has_graph ? scene.graphs[static_cast<std::size_t>(settings->graph_index)].view() : GraphProgramView{};
    const bool of_instance =
        std::any_of(program.inputs, program.inputs + program.num_inputs,
                    [&](const GraphInput& in) { return is_of_instance(in.quantity, mesh, in.index); });
    const auto [at, is_new] =
        known.try_emplace({instance.mesh_index, instance.displacement_index, of_instance ? static_cast<int>(i) : -1},
                          static_cast<int>(input->heights.size()));
    instance.heights_index = at->second;
    if (is_new) {
      ComputedHeights heights;
      if (has_graph) {
        const InstanceView placed = of_instance ? all->views.instances[i] : InstanceView{};
        all->heights.push_back(std::make_unique<GraphHeights>(GraphHeights{
            &mesh, placed, program, scene.textures->height_views().data(), scene.textures->height_bounds().data(),
            stage_table_select().run_graph, graph_bounds_select(), graph_scene, next_id.fetch_add(1)}));
        const GraphHeights* const graph = all->heights.back().get();
        if (settings->by_vectors) {
          heights.moves = {graph, eval<Vec3f>, eval_corners<Vec3f>};
        } else {
          heights.source = {graph, eval<float>, bounds};
          heights.corners = [graph](const std::uint32_t* corners, float* h) { eval_corners(graph, corners, h); };
        }
        heights.is_constant =
            std::none_of(program.inputs, program.inputs + program.num_inputs,
                         [&](const GraphInput& in) { return !is_of_all(in.quantity, mesh, in.index); });
      }
      heights.num_cells = settings->num_cells;
      places.push_back({&mesh, {}, settings});
      input->heights.push_back(std::move(heights));
    }
    places[static_cast<std::size_t>(at->second)].instances.push_back(instance.world_from_object);
  }
  for (std::size_t k = 0; k < places.size(); ++k) {
    const Place& place = places[k];
    if (place.settings->cell_length > 0) {
      input->heights[k].cells =
          input->heights[k].cells_seen = [cell = static_cast<double>(place.settings->cell_length)](Vec3f a, Vec3f b) {
            return length(to_double(b) - to_double(a)) / cell;
          };
      continue;
    }
    const PictureView view{camera, picture_height, static_cast<double>(place.settings->coarser_outside)};
    const auto cells = [&](SeenInstances::Coarser coarser) -> CellsAlong {
      const auto seen = std::make_shared<const SeenInstances>(*place.mesh, view, place.instances, coarser);
      const auto cell = static_cast<double>(place.settings->cell_pixels);
      return [seen, cell](Vec3f a, Vec3f b) { return seen->pixels(a, b) / cell; };
    };
    input->heights[k].cells = cells(SeenInstances::Coarser::kAfar);
    input->heights[k].cells_seen = cells(SeenInstances::Coarser::kOutside);
  }
}

}  // namespace relief
