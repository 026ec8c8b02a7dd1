#include "scene/gltf_mesh.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "scene/gltf_accessor.h"
#include "scene/memory.h"
#include "scene/tangents.h"

namespace relief {
namespace {

/// One primitive on its way to a mesh.
struct PrimitiveReader {
  const GltfDocument& document;
  const tinygltf::Primitive& primitive;
  std::string path;   ///< JSON path of the primitive
  std::string label;  ///< how warnings name it
  Warnings& warnings;

  std::string attribute_path(const std::string& name) const { return path + "/attributes/" + name; }

  void warn(const std::string& text) const { warnings.add(document.file + ": " + label + ": " + text); }

  /// Accessor of an attribute; empty if the primitive does not have it.
  /// @error SceneError for a wrong type, or another count than the positions'
  std::optional<AccessorView> open(const std::string& name,
                                   int min_components,
                                   int max_components,
                                   std::size_t num_vertices) const
  {
    const auto it = primitive.attributes.find(name);
    if (it == primitive.attributes.end()) {
      return {};
    }
    const AccessorView view = accessor_open(document, it->second, AccessorKind::kVertex, min_components, max_components,
                                            attribute_path(name));
    if (view.count != num_vertices) {
      throw SceneError(document.file, attribute_path(name),
                       "as many elements as POSITION (" + std::to_string(num_vertices) + ')',
                       std::to_string(view.count));
    }
    return view;
  }
};

/// Vertices and triangles are counted in 32 bits.
constexpr std::size_t kMostElements = 0xfffffffe;

/// Corner numbers of the primitive: its indices, or 0, 1, 2, …
std::vector<std::uint32_t> read_corners(const PrimitiveReader& reader, std::size_t num_vertices)
{
  if (reader.primitive.indices < 0) {
    std::vector<std::uint32_t> out(num_vertices);
    std::iota(out.begin(), out.end(), 0u);
    return out;
  }
  const std::string path = reader.path + "/indices";
  const AccessorView view = accessor_open(reader.document, reader.primitive.indices, AccessorKind::kIndex, 1, 1, path);
  std::vector<std::uint32_t> out = accessor_read_indices(view);
  if (out.size() > kMostElements) {
    throw SceneError(reader.document.file, path, "at most " + std::to_string(kMostElements) + " indices",
                     std::to_string(out.size()));
  }
  const std::uint32_t restart = view.component_type == TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE    ? 0xffu
                                : view.component_type == TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT ? 0xffffu
                                                                                                : 0xffffffffu;
  const std::uint32_t largest = *std::max_element(out.begin(), out.end());
  if (largest >= num_vertices || largest == restart) {
    const auto bad = std::find(out.begin(), out.end(), largest);
    throw SceneError(reader.document.file, path,
                     "indices below " + std::to_string(std::min<std::size_t>(num_vertices, restart)),
                     std::to_string(largest) + (largest == restart ? " (the restart value)" : "") + " at position " +
                         std::to_string(bad - out.begin()));
  }
  return out;
}

/// Triangles of a list, strip or fan.
/// @source glTF 2.0, section 3.7.2.1
std::vector<TriangleIndices> assemble_triangles(const PrimitiveReader& reader, const std::vector<std::uint32_t>& corner)
{
  const std::size_t n = corner.size();
  const int mode = reader.primitive.mode;
  std::vector<TriangleIndices> out;
  if (mode == TINYGLTF_MODE_TRIANGLES) {
    if (n % 3 != 0) {
      throw SceneError(reader.document.file, reader.path, "a multiple of 3 corners", std::to_string(n));
    }
    out.resize(n / 3);
    for (std::size_t i = 0; i < out.size(); ++i) {
      out[i] = {corner[3 * i], corner[3 * i + 1], corner[3 * i + 2]};
    }
    return out;
  }
  if (n < 3) {
    throw SceneError(reader.document.file, reader.path, "at least 3 corners", std::to_string(n));
  }
  out.resize(n - 2);
  for (std::size_t i = 0; i < out.size(); ++i) {
    const std::size_t odd = i % 2;
    out[i] = mode == TINYGLTF_MODE_TRIANGLE_STRIP ? TriangleIndices{corner[i], corner[i + 1 + odd], corner[i + 2 - odd]}
                                                  : TriangleIndices{corner[i + 1], corner[i + 2], corner[0]};
  }
  // Strips are stitched with corners that repeat; those triangles are a means, not a mistake.
  std::erase_if(out, [](const TriangleIndices& t) { return t.v0 == t.v1 || t.v1 == t.v2 || t.v2 == t.v0; });
  return out;
}

/// Zero area, judged in double: differences of floats and their products are exact or nearly so there.
bool has_no_area(Vec3f a, Vec3f b, Vec3f c)
{
  const double ux = static_cast<double>(b.x) - static_cast<double>(a.x),
               uy = static_cast<double>(b.y) - static_cast<double>(a.y),
               uz = static_cast<double>(b.z) - static_cast<double>(a.z);
  const double vx = static_cast<double>(c.x) - static_cast<double>(a.x),
               vy = static_cast<double>(c.y) - static_cast<double>(a.y),
               vz = static_cast<double>(c.z) - static_cast<double>(a.z);
  return uy * vz == uz * vy && uz * vx == ux * vz && ux * vy == uy * vx;
}

void drop_empty_triangles(const PrimitiveReader& reader, Mesh& mesh)
{
  const std::size_t dropped = std::erase_if(
      mesh.triangles, [&](const TriangleIndices& t) { return has_no_area(mesh.P[t.v0], mesh.P[t.v1], mesh.P[t.v2]); });
  if (dropped > 0) {
    reader.warn(std::to_string(dropped) + " triangles of zero area dropped");
  }
}

/// Makes normals unit. Where one is zero the triangles around say what it is.
void repair_normals(const PrimitiveReader& reader, Mesh& mesh)
{
  std::vector<bool> is_bad;
  std::size_t num_bad = 0;
  for (std::size_t v = 0; v < mesh.N.size(); ++v) {
    const Vec3f n = as_vector(mesh.N[v]);
    // Scaled first, so that the squares of tiny or huge normals neither vanish nor overflow.
    const float largest = max_component(abs(n));
    if (largest > 0) {
      mesh.N[v] = as_normal(normalize(n * (1.0f / largest)));
      if (is_finite(as_vector(mesh.N[v]))) {
        continue;
      }
    }
    is_bad.resize(mesh.N.size(), false);
    is_bad[v] = true;
    mesh.N[v] = {};
    ++num_bad;
  }
  if (num_bad == 0) {
    return;
  }
  for (const TriangleIndices& t : mesh.triangles) {
    const Vec3f across = cross(mesh.P[t.v1] - mesh.P[t.v0], mesh.P[t.v2] - mesh.P[t.v0]);
    const float size = length(across);
    for (const std::uint32_t v : {t.v0, t.v1, t.v2}) {
      if (is_bad[v] && size > 0) {
        mesh.N[v] = as_normal(as_vector(mesh.N[v]) + across / size);
      }
    }
  }
  for (std::size_t v = 0; v < mesh.N.size(); ++v) {
    if (is_bad[v]) {
      const Vec3f n = normalize(as_vector(mesh.N[v]));
      mesh.N[v] = is_finite(n) ? as_normal(n) : Normal3f{0, 0, 1};
    }
  }
  reader.warn(std::to_string(num_bad) + " zero normals replaced by those of the triangles around them");
}

/// Unit tangents with w = ±1.
void repair_tangents(const PrimitiveReader& reader, Mesh& mesh)
{
  std::size_t num_bad = 0;
  for (std::size_t v = 0; v < mesh.tangent.size(); ++v) {
    Vec3f t = normalize(xyz(mesh.tangent[v]));
    if (!is_finite(t)) {
      t = frame_from_normal(as_vector(mesh.N[v])).s;
      ++num_bad;
    }
    mesh.tangent[v] = {t.x, t.y, t.z, mesh.tangent[v].w < 0 ? -1.0f : 1.0f};
  }
  if (num_bad > 0) {
    reader.warn(std::to_string(num_bad) + " zero tangents replaced");
  }
}

std::vector<Vec4f> read_colors(const AccessorView& view, std::size_t first, std::size_t count)
{
  std::vector<Vec4f> out(count);
  if (view.num_components == 4) {
    out = accessor_read<Vec4f>(view, first, count);
  } else {
    const std::vector<Vec3f> rgb = accessor_read<Vec3f>(view, first, count);
    std::transform(rgb.begin(), rgb.end(), out.begin(), [](Vec3f c) { return Vec4f{c.x, c.y, c.z, 1}; });
  }
  for (Vec4f& c : out) {
    c = {max(c.x, 0.0f), max(c.y, 0.0f), max(c.z, 0.0f), clamp(c.w, 0.0f, 1.0f)};
  }
  return out;
}

/// Vertices [first, first + count) of every attribute.
void read_attributes(const PrimitiveReader& reader,
                     const AccessorView& positions,
                     std::size_t first,
                     std::size_t count,
                     const std::map<std::string, std::uint16_t>& columns,
                     Mesh& mesh)
{
  const auto normals = reader.open("NORMAL", 3, 3, positions.count);
  const auto tangents = reader.open("TANGENT", 4, 4, positions.count);
  const auto colors = reader.open("COLOR_0", 3, 4, positions.count);
  const auto generated = reader.open("_GENERATED", 3, 3, positions.count);
  mesh.P = accessor_read<Vec3f>(positions, first, count);
  for (const auto& [name, place] : columns) {
    if (const auto view = reader.open(name, 1, 4, positions.count)) {
      AttributeColumn& column = mesh.columns.emplace_back();
      column.name = place;
      column.num_components = view->num_components;
      column.values.resize(count * static_cast<std::size_t>(view->num_components));
      if (count > 0) accessor_read_floats(*view, first, count, column.values.data());
    }
  }
  if (generated) {
    mesh.generated = accessor_read<Vec3f>(*generated, first, count);
  }
  for (int set = 0; set < 2; ++set) {
    if (const auto uv = reader.open("TEXCOORD_" + std::to_string(set), 2, 2, positions.count)) {
      mesh.uv[set] = accessor_read<Vec2f>(*uv, first, count);
    }
  }
  if (normals) {
    mesh.N = accessor_read<Normal3f>(*normals, first, count);
  }
  if (colors) {
    mesh.color = read_colors(*colors, first, count);
  }
  // Tangents without normals mean nothing (glTF 2.0, section 3.7.2.1).
  if (tangents && normals) {
    mesh.tangent = accessor_read<Vec4f>(*tangents, first, count);
  }
}

enum class CurveShape : std::uint8_t { kTubes, kRibbons, kPoints };

/// What RELIEF_curves or RELIEF_points says of a primitive; empty: it has neither.
std::optional<CurveShape> read_curve_shape(const PrimitiveReader& reader, const nlohmann::json& json)
{
  std::optional<CurveShape> shape;
  const int mode = reader.primitive.mode;
  reader.document.read_extension(json, reader.path, "RELIEF_curves", [&](const JsonReader& r) {
    if (mode != TINYGLTF_MODE_LINE && mode != TINYGLTF_MODE_LINE_LOOP && mode != TINYGLTF_MODE_LINE_STRIP) {
      throw SceneError(reader.document.file, reader.path + "/mode", "lines (1, 2 or 3), as curves are",
                       std::to_string(mode));
    }
    constexpr std::string_view kShapes[] = {"ribbons", "tubes"};
    shape = r.choice("shape", kShapes, 0) == 0 ? CurveShape::kRibbons : CurveShape::kTubes;
    r.warn_unread(reader.warnings);
  });
  reader.document.read_extension(json, reader.path, "RELIEF_points", [&](const JsonReader& r) {
    if (mode != TINYGLTF_MODE_POINTS) {
      throw SceneError(reader.document.file, reader.path + "/mode", "points (0)", std::to_string(mode));
    }
    shape = CurveShape::kPoints;
    r.warn_unread(reader.warnings);
  });
  return shape;
}

/// _RADIUS of the vertices [first, first + count).
std::vector<float> read_radii(const PrimitiveReader& reader,
                              std::size_t num_file_vertices,
                              std::size_t first,
                              std::size_t count)
{
  const auto view = reader.open("_RADIUS", 1, 1, num_file_vertices);
  if (!view) throw SceneError(reader.document.file, reader.attribute_path("_RADIUS"), "an accessor", "nothing");
  std::vector<float> out(count);
  if (count > 0) accessor_read_floats(*view, first, count, out.data());
  const auto least = std::min_element(out.begin(), out.end());
  if (least != out.end() && *least < 0) {
    throw SceneError(reader.document.file, reader.attribute_path("_RADIUS"), "radii of at least 0",
                     std::to_string(*least) + " at position " +
                         std::to_string(static_cast<std::size_t>(least - out.begin()) + first));
  }
  return out;
}

/// How the segments of a primitive's lines are joined: a curve for each run in which one begins where the one before ended.
std::vector<std::vector<std::uint32_t>> assemble_curves(const PrimitiveReader& reader,
                                                        const std::vector<std::uint32_t>& corner)
{
  const std::size_t n = corner.size();
  std::vector<std::vector<std::uint32_t>> curves;
  if (reader.primitive.mode != TINYGLTF_MODE_LINE) {
    curves.push_back(corner);
    if (reader.primitive.mode == TINYGLTF_MODE_LINE_LOOP) curves.back().push_back(corner.front());
    return curves;
  }
  if (n % 2 != 0) {
    throw SceneError(reader.document.file, reader.path, "a multiple of 2 corners", std::to_string(n));
  }
  for (std::size_t i = 0; i < n; i += 2) {
    if (curves.empty() || curves.back().back() != corner[i]) curves.push_back({corner[i]});
    curves.back().push_back(corner[i + 1]);
  }
  return curves;
}

/// Name of columns that are the positions and normals of one step after the other, until the mesh has its last vertices: whatever
/// copies or drops vertices does so with them.
constexpr std::uint16_t kStepColumn = 0xffff;

/// Sum of the targets' displacements of one attribute, by weights.
/// @param name  POSITION or NORMAL
std::vector<Vec3f> target_sum(const PrimitiveReader& reader,
                              const std::string& name,
                              std::size_t num_file_vertices,
                              std::size_t first,
                              std::size_t count,
                              const std::vector<double>& weights)
{
  std::vector<Vec3f> sum(count);
  for (std::size_t k = 0; k < std::min(weights.size(), reader.primitive.targets.size()); ++k) {
    const auto found = reader.primitive.targets[k].find(name);
    if (weights[k] == 0 || found == reader.primitive.targets[k].end()) continue;
    const std::string path = reader.path + "/targets/" + std::to_string(k) + '/' + name;
    const AccessorView view = accessor_open(reader.document, found->second, AccessorKind::kVertex, 3, 3, path);
    if (view.count != num_file_vertices) {
      throw SceneError(reader.document.file, path,
                       "as many elements as POSITION (" + std::to_string(num_file_vertices) + ')',
                       std::to_string(view.count));
    }
    const std::vector<Vec3f> values = accessor_read<Vec3f>(view, first, count);
    const auto weight = static_cast<float>(weights[k]);
    for (std::size_t v = 0; v < count; ++v) sum[v] += weight * values[v];
  }
  return sum;
}

/// Applies morph targets to positions and normals, and adds columns of those of the steps.
/// @param num_file_vertices  that the primitive's accessors have
void read_targets(const PrimitiveReader& reader,
                  std::size_t num_file_vertices,
                  std::size_t first,
                  std::size_t count,
                  const MorphWeights& morph,
                  Mesh& mesh)
{
  const std::vector<Vec3f> P = mesh.P;
  const std::vector<Normal3f> N = mesh.N;
  const auto sum = [&](const char* name, const std::vector<double>& weights) {
    return target_sum(reader, name, num_file_vertices, first, count, weights);
  };
  const auto add_column = [&](const std::vector<Vec3f>& values) {
    AttributeColumn& column = mesh.columns.emplace_back();
    column.name = kStepColumn;
    column.num_components = 3;
    for (const Vec3f v : values) column.values.insert(column.values.end(), {v.x, v.y, v.z});
  };
  const auto morphed = [&](const std::vector<double>& weights) {
    std::vector<Vec3f> positions = sum("POSITION", weights);
    for (std::size_t v = 0; v < count; ++v) positions[v] += P[v];
    if (!std::all_of(positions.begin(), positions.end(), [](Vec3f p) { return is_finite(p); })) {
      throw SceneError(reader.document.file, reader.path + "/targets", "weighted positions within single precision",
                       "others");
    }
    return positions;
  };
  const auto morphed_normals = [&](const std::vector<double>& weights) {
    std::vector<Vec3f> normals = sum("NORMAL", weights);
    for (std::size_t v = 0; v < count; ++v) normals[v] += as_vector(N[v]);
    return normals;
  };
  if (reader.primitive.targets.empty()) return;
  mesh.P = morphed(morph.weights);
  if (!N.empty()) {
    const std::vector<Vec3f> normals = morphed_normals(morph.weights);
    std::transform(normals.begin(), normals.end(), mesh.N.begin(), [](Vec3f n) { return as_normal(n); });
  }
  for (const std::vector<double>& weights : morph.steps) {
    add_column(morphed(weights));
    if (!N.empty()) add_column(morphed_normals(weights));
  }
}

/// Takes the columns of steps out again, to where they belong.
void take_steps(std::size_t num_steps, Mesh& mesh)
{
  std::vector<std::vector<Vec3f>> taken;
  for (const AttributeColumn& column : mesh.columns) {
    if (column.name != kStepColumn) continue;
    std::vector<Vec3f>& values = taken.emplace_back(mesh.P.size());
    for (std::size_t v = 0; v < values.size(); ++v) {
      values[v] = {column.values[3 * v], column.values[3 * v + 1], column.values[3 * v + 2]};
    }
  }
  std::erase_if(mesh.columns, [](const AttributeColumn& column) { return column.name == kStepColumn; });
  const std::size_t a_step = mesh.N.empty() ? 1 : 2;
  for (std::size_t i = 0; i < num_steps && a_step * i < taken.size(); ++i) {
    MeshStep& step = mesh.steps.emplace_back();
    step.P = std::move(taken[a_step * i]);
    // Embree reads 16 bytes a vertex.
    step.P.reserve(step.P.size() + 1);
    if (mesh.N.empty()) continue;
    step.N = mesh.N;
    for (std::size_t v = 0; v < step.N.size(); ++v) {
      const Vec3f n = normalize(taken[a_step * i + 1][v]);
      if (is_finite(n)) step.N[v] = as_normal(n);
    }
  }
}

/// Tangents that graphs read, as columns.
void derive_tangent_columns(const std::map<std::string, std::uint16_t>& columns, Mesh& mesh)
{
  for (int set = 0; set < 2; ++set) {
    const auto it = columns.find(tangent_attribute_name(set));
    if (it == columns.end() || mesh.uv[set].empty()) continue;
    std::vector<Vec4f> own = std::move(mesh.tangent);
    const bool is_own = set == 0 && !own.empty();
    if (!is_own) tangents_derive(mesh, set);
    const std::vector<Vec4f>& tangents = is_own ? own : mesh.tangent;
    AttributeColumn column{it->second, 4, {}};
    column.values.reserve(4 * tangents.size());
    for (const Vec4f& t : tangents) column.values.insert(column.values.end(), {t.x, t.y, t.z, t.w});
    mesh.columns.push_back(std::move(column));
    // Deriving may have given some vertices a copy; what the file has is as good as what is derived then.
    if (is_own || own.size() == mesh.tangent.size()) {
      mesh.tangent = std::move(own);
    } else {
      mesh.tangent.clear();
    }
  }
}

/// Normals that graphs read, as a column: a displaced mesh may have others.
void derive_normal_column(const std::map<std::string, std::uint16_t>& columns, Mesh& mesh)
{
  const auto it = columns.find(kBaseNormalAttribute);
  if (it == columns.end() || mesh.N.empty()) return;
  AttributeColumn column{it->second, 3, {}};
  column.values.reserve(3 * mesh.N.size());
  for (const Normal3f& n : mesh.N) column.values.insert(column.values.end(), {n.x, n.y, n.z});
  mesh.columns.push_back(std::move(column));
}

template <typename T>
void keep(std::vector<T>& values, const std::vector<std::uint32_t>& kept)
{
  if (values.empty()) {
    return;
  }
  std::vector<T> out;
  out.reserve(kept.size());
  for (const std::uint32_t v : kept) {
    out.push_back(values[v]);
  }
  values = std::move(out);
}

/// Puts vertices in another order; some may stand there more than once, others not at all.
void reorder_vertices(const std::vector<std::uint32_t>& kept, Mesh& mesh)
{
  keep(mesh.P, kept);
  keep(mesh.N, kept);
  keep(mesh.tangent, kept);
  keep(mesh.color, kept);
  keep(mesh.generated, kept);
  keep(mesh.radius, kept);
  for (AttributeColumn& column : mesh.columns) {
    const auto n = static_cast<std::uint32_t>(column.num_components);
    std::vector<std::uint32_t> numbers;
    for (const std::uint32_t v : kept) {
      for (std::uint32_t c = 0; c < n; ++c) numbers.push_back(v * n + c);
    }
    keep(column.values, numbers);
  }
  for (std::vector<Vec2f>& uv : mesh.uv) {
    keep(uv, kept);
  }
}

/// Lays out a mesh's vertices along its curves, see Mesh.
/// @param first  number in the file of the mesh's first vertex
void lay_out_curves(const PrimitiveReader& reader,
                    const std::vector<std::vector<std::uint32_t>>& curves,
                    std::uint32_t first,
                    Mesh& mesh)
{
  std::vector<std::uint32_t> order;
  std::size_t num_dropped = 0;
  for (const std::vector<std::uint32_t>& curve : curves) {
    // Points where the one before is give no direction.
    std::vector<std::uint32_t> points;
    bool is_wide = false;
    for (const std::uint32_t corner : curve) {
      const std::uint32_t v = corner - first;
      is_wide = is_wide || mesh.radius[v] > 0;
      if (points.empty() || mesh.P[points.back()] != mesh.P[v]) points.push_back(v);
    }
    if (points.size() < 2 || !is_wide) {
      ++num_dropped;
      continue;
    }
    const auto begin = static_cast<std::uint32_t>(order.size()) + 1;
    order.push_back(points.front());
    order.insert(order.end(), points.begin(), points.end());
    order.push_back(points.back());
    for (std::uint32_t i = 0; i + 1 < points.size(); ++i) {
      mesh.triangles.push_back({begin + i, begin + i + 1, begin + i});
    }
  }
  if (num_dropped > 0) reader.warn(std::to_string(num_dropped) + " curves without a length or a width dropped");
  if (order.size() > kMostElements) {
    throw SceneError(reader.document.file, reader.path,
                     "at most " + std::to_string(kMostElements) + " vertices of curves", std::to_string(order.size()));
  }
  reorder_vertices(order, mesh);
}

/// Lays out a mesh's vertices as balls, see Mesh: those that the primitive has, but not twice, and that have a size.
/// @param first  number in the file of the mesh's first vertex
void lay_out_points(const PrimitiveReader& reader,
                    const std::vector<std::uint32_t>& corners,
                    std::uint32_t first,
                    Mesh& mesh)
{
  std::vector<std::uint32_t> order;
  std::vector<bool> is_there(mesh.P.size(), false);
  std::size_t num_dropped = 0;
  for (const std::uint32_t corner : corners) {
    const std::uint32_t v = corner - first;
    if (is_there[v]) continue;
    is_there[v] = true;
    if (mesh.radius[v] > 0) {
      order.push_back(v);
    } else {
      ++num_dropped;
    }
  }
  if (num_dropped > 0) reader.warn(std::to_string(num_dropped) + " points of radius 0 dropped");
  for (std::uint32_t i = 0; i < order.size(); ++i) mesh.triangles.push_back({i, i, i});
  reorder_vertices(order, mesh);
}

/// Drops the vertices that no triangle has, where they are the most: many primitives may share one large accessor.
void drop_unused_vertices(Mesh& mesh)
{
  constexpr std::uint32_t kUnused = 0xffffffff;
  std::vector<std::uint32_t> new_index(mesh.P.size(), kUnused), kept;
  for (const TriangleIndices& t : mesh.triangles) {
    for (const std::uint32_t v : {t.v0, t.v1, t.v2}) {
      if (new_index[v] == kUnused) {
        new_index[v] = 0;
        kept.push_back(v);
      }
    }
  }
  if (2 * kept.size() >= mesh.P.size()) {
    return;
  }
  std::sort(kept.begin(), kept.end());
  for (std::size_t i = 0; i < kept.size(); ++i) {
    new_index[kept[i]] = static_cast<std::uint32_t>(i);
  }
  for (TriangleIndices& t : mesh.triangles) {
    t = {new_index[t.v0], new_index[t.v1], new_index[t.v2]};
  }
  reorder_vertices(kept, mesh);
}

}  // namespace

namespace {

/// The accessor of a primitive that has nothing to read; empty: there is none.
std::string empty_accessor(const GltfDocument& document, const tinygltf::Primitive& primitive)
{
  const auto is_empty = [&](int index) {
    if (index < 0) return false;
    const int view = document.core.accessors[static_cast<std::size_t>(index)].bufferView;
    return view >= 0 && document.core.bufferViews[static_cast<std::size_t>(view)].byteLength == 0;
  };
  const auto name = [](int index) { return "/accessors/" + std::to_string(index); };
  if (is_empty(primitive.indices)) return name(primitive.indices);
  for (const auto& [attribute, index] : primitive.attributes) {
    if (is_empty(index)) return name(index);
  }
  for (const std::map<std::string, int>& target : primitive.targets) {
    for (const auto& [attribute, index] : target) {
      if (is_empty(index)) return name(index);
    }
  }
  return {};
}

}  // namespace

std::optional<Mesh> gltf_mesh_load(const GltfDocument& document,
                                   int mesh_index,
                                   int primitive_index,
                                   const MorphWeights& morph,
                                   int tangent_uv_set,
                                   const std::map<std::string, std::uint16_t>& columns,
                                   Warnings& warnings)
{
  const tinygltf::Mesh& source = document.core.meshes[static_cast<std::size_t>(mesh_index)];
  const std::string mesh_path = "/meshes/" + std::to_string(mesh_index);
  PrimitiveReader reader{document, source.primitives[static_cast<std::size_t>(primitive_index)],
                         mesh_path + "/primitives/" + std::to_string(primitive_index), "", warnings};
  reader.label = reader.path + (source.name.empty() ? "" : " (" + source.name + ')');
  const std::optional<CurveShape> curves =
      read_curve_shape(reader, document.element("meshes", static_cast<std::size_t>(mesh_index))
                                   .at("primitives")
                                   .at(static_cast<std::size_t>(primitive_index)));
  if (reader.primitive.mode < TINYGLTF_MODE_TRIANGLES && !curves) {
    reader.warn("points and lines are not rendered without RELIEF_points or RELIEF_curves");
    return {};
  }
  if (const std::string empty = empty_accessor(document, reader.primitive); !empty.empty()) {
    reader.warn(empty + " reads from a buffer view without a byte: left out");
    return {};
  }
  const auto position = reader.primitive.attributes.find("POSITION");
  if (position == reader.primitive.attributes.end()) {
    throw SceneError(document.file, reader.attribute_path("POSITION"), "an accessor", "nothing");
  }
  const AccessorView positions =
      accessor_open(document, position->second, AccessorKind::kVertex, 3, 3, reader.attribute_path("POSITION"));
  if (positions.count > kMostElements) {
    throw SceneError(document.file, reader.attribute_path("POSITION"),
                     "at most " + std::to_string(kMostElements) + " vertices", std::to_string(positions.count));
  }
  Mesh mesh;
  mesh.name = source.name;
  {
    const std::vector<std::uint32_t> corners = read_corners(reader, positions.count);
    if (!curves) mesh.triangles = assemble_triangles(reader, corners);
    const auto [lowest, highest] = std::minmax_element(corners.begin(), corners.end());
    const std::uint32_t first = *lowest;
    for (TriangleIndices& t : mesh.triangles) {
      t = {t.v0 - first, t.v1 - first, t.v2 - first};
    }
    const std::size_t num_vertices = *highest - first + 1;
    constexpr std::size_t kMostVertexBytes =
        2 * sizeof(Vec3f) + sizeof(Normal3f) + 2 * sizeof(Vec2f) + 2 * sizeof(Vec4f);
    // Of curves there are copies while they are laid out, and Embree's.
    constexpr std::size_t kCurveBytes = 96;
    constexpr std::size_t kWorthALook = std::size_t{1} << 20;
    const std::size_t vertex_bytes = kMostVertexBytes + columns.size() * sizeof(Vec4f) +
                                     morph.steps.size() * (sizeof(Vec3f) + sizeof(Normal3f)) +
                                     (curves ? kCurveBytes : 0);
    if (num_vertices > kWorthALook / vertex_bytes) {
      memory_require(num_vertices * vertex_bytes, document.file + ": " + reader.path);
    }
    read_attributes(reader, positions, first, num_vertices, columns, mesh);
    read_targets(reader, positions.count, first, num_vertices, morph, mesh);
    if (curves) {
      mesh.are_ribbons = *curves == CurveShape::kRibbons;
      mesh.are_points = *curves == CurveShape::kPoints;
      mesh.radius = read_radii(reader, positions.count, first, num_vertices);
      if (mesh.are_points) {
        lay_out_points(reader, corners, first, mesh);
      } else {
        lay_out_curves(reader, assemble_curves(reader, corners), first, mesh);
      }
    }
  }
  if (curves) {
    if (mesh.triangles.empty()) {
      reader.warn(std::string(mesh.are_points ? "no point has a radius" : "no curve has a length and a width") +
                  "; nothing is rendered");
      return {};
    }
    mesh.N.clear();
    mesh.tangent.clear();
    take_steps(morph.steps.size(), mesh);
    return mesh;
  }
  drop_unused_vertices(mesh);
  drop_empty_triangles(reader, mesh);
  if (mesh.triangles.empty()) {
    reader.warn("no triangle has an area; nothing is rendered");
    return {};
  }
  repair_normals(reader, mesh);
  repair_tangents(reader, mesh);
  derive_tangent_columns(columns, mesh);
  derive_normal_column(columns, mesh);
  if (tangent_uv_set >= 0 && mesh.tangent.empty() && !mesh.uv[tangent_uv_set].empty()) {
    tangents_derive(mesh, tangent_uv_set);
  }
  take_steps(morph.steps.size(), mesh);
  return mesh;
}

}  // namespace relief
