#include "displacement/include/relief/displaced_geometry.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

#include "displacement/cpu.h"
#include "displacement/displaced_mesh.h"
#include "displacement/embree_geometry.h"
#include "displacement/height_field.h"

namespace relief {

namespace {

[[noreturn]] void fail(const std::string& what) { throw std::invalid_argument("relief::DisplacementSource: " + what); }

void check_numbers(std::span<const float> numbers, const char* name)
{
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    if (!std::isfinite(numbers[i]))
      fail(std::string(name) + "[" + std::to_string(i) + "]: expected a finite number, found " + std::to_string(numbers[i]));
  }
}

void check_number(float number, const char* name)
{
  if (!std::isfinite(number)) fail(std::string(name) + ": expected a finite number, found " + std::to_string(number));
}

float largest(std::span<const float> numbers, float from = 0)
{
  float out = 0;
  for (const float number : numbers) out = std::max(out, std::abs(number - from));
  return out;
}

void check_size(std::size_t found, std::size_t expected, const char* name)
{
  if (found != expected)
    fail(std::string(name) + ": expected " + std::to_string(expected) + " entries, found " + std::to_string(found));
}

void check(const DisplacementSource& s)
{
  if (s.positions.empty() || s.positions.size() % 3 != 0)
    fail("positions: expected three entries a vertex, found " + std::to_string(s.positions.size()));
  if (s.triangles.empty() || s.triangles.size() % 3 != 0)
    fail("triangles: expected three entries a triangle, found " + std::to_string(s.triangles.size()));
  const std::size_t num_vertices = s.positions.size() / 3;
  constexpr std::size_t kMostIndices = std::numeric_limits<std::uint32_t>::max();
  if (num_vertices > kMostIndices || s.triangles.size() / 3 > kMostIndices) fail("expected fewer than 2^32 vertices and triangles");
  check_size(s.normals.size(), s.positions.size(), "normals");
  check_size(s.uv.size(), 2 * num_vertices, "uv");
  constexpr std::size_t kMostTexelsASide = 65536;
  if (s.map_width < 1 || s.map_height < 1 || s.map_width > kMostTexelsASide || s.map_height > kMostTexelsASide) {
    fail("expected a map of 1 to 65536 texels a side, found " + std::to_string(s.map_width) + " x " +
         std::to_string(s.map_height));
  }
  check_size(s.heights.size(), s.map_width * s.map_height, "heights");
  check_numbers(s.positions, "positions");
  check_numbers(s.normals, "normals");
  check_numbers(s.uv, "uv");
  check_numbers(s.heights, "heights");
  check_number(s.scale, "scale");
  check_number(s.midlevel, "midlevel");
  // Embree leaves out what is 1.8e18 from the origin, without a word.
  constexpr float kFarthest = 1e18f;
  const float far = largest(s.positions), move = std::abs(s.scale) * largest(s.heights, s.midlevel);
  if (!(far + move <= kFarthest)) {
    std::ostringstream text;
    text << "expected a surface within 1e18 of the origin, found positions up to " << far
         << ", which heights move by up to " << move;
    fail(text.str());
  }
  for (std::size_t i = 0; i < s.triangles.size(); ++i) {
    if (s.triangles[i] >= num_vertices) {
      fail("triangles[" + std::to_string(i) + "]: expected the index of one of " + std::to_string(num_vertices) +
           " vertices, found " + std::to_string(s.triangles[i]));
    }
  }
  for (std::size_t i = 0; i < s.normals.size(); i += 3) {
    if (s.normals[i] == 0 && s.normals[i + 1] == 0 && s.normals[i + 2] == 0)
      fail("normals[" + std::to_string(i) + "]: expected a direction, found 0 0 0");
  }
}

const TraversalTable& table_select()
{
#ifdef RELIEF_BUILT_avx2
  if (cpu_has_avx2()) return traversal_table_avx2();
#endif
#ifdef RELIEF_BUILT_baseline
  return traversal_table_baseline();
#else
  throw std::runtime_error("relief was built for processors with AVX2, FMA, BMI2 and F16C alone");
#endif
}

/// Numbers as vectors.
template <typename V>
std::vector<V> vectors(std::span<const float> numbers, int exponent = 0)
{
  std::vector<V> out(numbers.size() / 3);
  for (std::size_t i = 0; i < out.size(); ++i) {
    out[i] = {std::scalbn(numbers[3 * i], exponent), std::scalbn(numbers[3 * i + 1], exponent),
              std::scalbn(numbers[3 * i + 2], exponent)};
  }
  return out;
}

/// By which power of two normals are multiplied, so that squares of long or short ones are numbers. It changes no direction between them.
int normals_exponent(std::span<const float> normals) { return -std::ilogb(largest(normals)); }

}  // namespace

namespace {

/// User data of the geometry.
struct Traced : DisplacedGeometry {
  const TraversalTable* table = nullptr;
};

/// @param user_data  not null
const Traced& traced_of(const void* user_data)
{
  return *static_cast<const Traced*>(static_cast<const DisplacedGeometry*>(user_data));
}

/// relief's callbacks want a context of relief's own: they get one, with what the caller's says.
EmbreeContext context_around(const auto& context)
{
  EmbreeContext own;
  own.rtc = context;
  return own;
}

void bounds(const RTCBoundsFunctionArguments* given)
{
  // Of a geometry that has ended: nothing, which Embree leaves out.
  Box3 box = box_empty();
  if (given->geometryUserPtr != nullptr)
    box = displaced_triangle_bounds(traced_of(given->geometryUserPtr).mesh, given->primID);
  *given->bounds_o = {box.low.x, box.low.y, box.low.z, 0, box.high.x, box.high.y, box.high.z, 0};
}

void intersect(const RTCIntersectFunctionNArguments* given)
{
  if (given->geometryUserPtr == nullptr) return;
  const Traced& traced = traced_of(given->geometryUserPtr);
  EmbreeContext context = context_around(*given->context);
  RTCIntersectFunctionNArguments arguments = *given;
  arguments.context = &context.rtc;
  RTCHitN* hits = RTCRayHitN_HitN(given->rayhit, given->N);
  // A hit may be as far, in floats, as the one before: that it is new is told by a number that no hit notes.
  constexpr unsigned kMostRays = 16;
  float before[kMostRays];
  for (unsigned k = 0; k < given->N; ++k) {
    before[k] = RTCHitN_Ng_x(hits, given->N, k);
    RTCHitN_Ng_x(hits, given->N, k) = std::numeric_limits<float>::quiet_NaN();
  }
  traced.table->intersect(&arguments);
  for (unsigned k = 0; k < given->N; ++k) {
    if (std::isnan(RTCHitN_Ng_x(hits, given->N, k))) {
      RTCHitN_Ng_x(hits, given->N, k) = before[k];
      continue;
    }
    // In place of what relief notes there, the normal that every program expects.
    const DisplacedPlace place =
        displaced_hit_decode({RTCHitN_u(hits, given->N, k), RTCHitN_v(hits, given->N, k), RTCHitN_Ng_x(hits, given->N, k)});
    const Vec3f Ng = to_float(displaced_surface_point(traced, given->primID, place).Ng);
    RTCHitN_Ng_x(hits, given->N, k) = Ng.x;
    RTCHitN_Ng_y(hits, given->N, k) = Ng.y;
    RTCHitN_Ng_z(hits, given->N, k) = Ng.z;
  }
}

void occluded(const RTCOccludedFunctionNArguments* given)
{
  if (given->geometryUserPtr == nullptr) return;
  EmbreeContext context = context_around(*given->context);
  RTCOccludedFunctionNArguments arguments = *given;
  arguments.context = &context.rtc;
  traced_of(given->geometryUserPtr).table->occluded(&arguments);
}

}  // namespace

/// Stays where it is: Embree, and what is below, point to what is above.
struct DisplacedEmbreeGeometry::State {
  std::vector<Vec3f> P;
  std::vector<Normal3f> N;
  std::vector<Vec2f> uv;
  std::vector<TriangleIndices> triangles;
  std::vector<float> heights;
  HeightField field;
  DisplacedMesh mesh;
  MethodTable method_table;
  Traced traced;
  RTCGeometry geometry = nullptr;

  explicit State(const DisplacementSource& source)
      : P(vectors<Vec3f>(source.positions)),
        N(vectors<Normal3f>(source.normals, normals_exponent(source.normals))),
        uv(source.uv.size() / 2),
        triangles(source.triangles.size() / 3),
        heights(source.heights.begin(), source.heights.end())
  {
    for (std::size_t i = 0; i < uv.size(); ++i) uv[i] = {source.uv[2 * i], source.uv[2 * i + 1]};
    for (std::size_t i = 0; i < triangles.size(); ++i)
      triangles[i] = {source.triangles[3 * i], source.triangles[3 * i + 1], source.triangles[3 * i + 2]};
    const Wrap wrap = source.map_repeats ? Wrap::kRepeat : Wrap::kClamp;
    field = HeightField({heights.data(), static_cast<int>(source.map_width), static_cast<int>(source.map_height),
                         HeightFormat::kFloat, wrap, wrap});
    MeshView view;
    view.P = P.data();
    view.N = N.data();
    view.uv[0] = uv.data();
    view.triangles = triangles.data();
    view.num_vertices = static_cast<std::uint32_t>(P.size());
    view.num_triangles = static_cast<std::uint32_t>(triangles.size());
    DisplacementMapping mapping;
    mapping.scale = static_cast<double>(source.scale);
    mapping.midlevel = static_cast<double>(source.midlevel);
    mesh = DisplacedMesh(view, field.view(), mapping);
    traced.mesh = mesh.view();
    traced.table = &table_select();
    traced.levels[0].field = &field.view();
    if (const auto table_make = displacement_method(traced.method).table_make) {
      method_table = table_make(field.view(), {});
      traced.levels[0].table = method_table.view;
    }
    traced.lod.texel = mesh.widest_texel();
  }
  State(const State&) = delete;
  State& operator=(const State&) = delete;
  ~State()
  {
    if (geometry == nullptr) return;
    // A scene may still hold it.
    rtcSetGeometryUserData(geometry, nullptr);
    rtcReleaseGeometry(geometry);
  }
};

DisplacedEmbreeGeometry::DisplacedEmbreeGeometry(RTCDevice device, const DisplacementSource& source)
{
  if (device == nullptr) throw std::invalid_argument("relief::DisplacedEmbreeGeometry: expected a device of Embree, found null");
  check(source);
  state_ = std::make_unique<State>(source);
  state_->geometry = displaced_geometry_make(device, state_->traced, *state_->traced.table);
  rtcSetGeometryBoundsFunction(state_->geometry, bounds, nullptr);
  rtcSetGeometryIntersectFunction(state_->geometry, intersect);
  rtcSetGeometryOccludedFunction(state_->geometry, occluded);
  rtcCommitGeometry(state_->geometry);
}

DisplacedEmbreeGeometry::~DisplacedEmbreeGeometry() = default;
DisplacedEmbreeGeometry::DisplacedEmbreeGeometry(DisplacedEmbreeGeometry&&) noexcept = default;
DisplacedEmbreeGeometry& DisplacedEmbreeGeometry::operator=(DisplacedEmbreeGeometry&&) noexcept = default;

RTCGeometry DisplacedEmbreeGeometry::geometry() const noexcept { return state_->geometry; }

DisplacedSurfacePoint DisplacedEmbreeGeometry::point(unsigned triangle, float u, float v) const noexcept
{
  DisplacedPlace place;
  place.b1 = u;
  place.b2 = v;
  const SurfacePoint on = displaced_surface_point(state_->traced, triangle, place);
  const Vec3f P = to_float(on.P), Ng = to_float(on.Ng);
  const TriangleIndices& corners = state_->triangles[triangle];
  const Vec2f a = state_->uv[corners.v0], b = state_->uv[corners.v1], c = state_->uv[corners.v2];
  const float w = 1.0f - u - v;
  return {{P.x, P.y, P.z}, {Ng.x, Ng.y, Ng.z}, {w * a.x + u * b.x + v * c.x, w * a.y + u * b.y + v * c.y}};
}

std::size_t DisplacedEmbreeGeometry::bytes() const noexcept
{
  const State& s = *state_;
  return s.P.size() * sizeof(Vec3f) + s.N.size() * sizeof(Normal3f) + s.uv.size() * sizeof(Vec2f) +
         s.triangles.size() * sizeof(TriangleIndices) + s.heights.size() * sizeof(float) + s.field.bytes() + s.mesh.bytes() +
         s.method_table.bytes;
}

}  // namespace relief
