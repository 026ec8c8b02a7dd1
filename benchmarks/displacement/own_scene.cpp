#include "benchmarks/displacement/own_scene.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <map>

#include "benchmarks/displacement/obj_file.h"
#include "displacement/vec3d.h"
#include "exporters/errors.h"
#include "scene/load.h"
#include "scene/texture_store.h"

namespace relief {

namespace {

/// Normals of triangles, in proportion to their areas, of all vertices at the same place.
std::vector<Normal3f> smooth_normals(const std::vector<Vec3f>& P, const std::vector<TriangleIndices>& triangles)
{
  std::map<std::array<float, 3>, Vec3d> sums;
  const auto sum_at = [&](std::uint32_t v) -> Vec3d& { return sums[{P[v].x, P[v].y, P[v].z}]; };
  for (const TriangleIndices& t : triangles) {
    const Vec3d n = cross(to_double(P[t.v1]) - to_double(P[t.v0]), to_double(P[t.v2]) - to_double(P[t.v0]));
    for (const std::uint32_t v : {t.v0, t.v1, t.v2}) sum_at(v) = sum_at(v) + n;
  }
  std::vector<Normal3f> normals;
  for (std::uint32_t v = 0; v < P.size(); ++v) {
    const Vec3d n = sum_at(v);
    const double size = length(n);
    // What no triangle with an area has is seen by no ray.
    const Vec3f unit = size > 0 ? to_float(n * (1 / size)) : Vec3f{0, 1, 0};
    normals.push_back({unit.x, unit.y, unit.z});
  }
  return normals;
}

/// All meshes of a scene, where they stand.
void append_meshes(const std::string& file, BenchScene& out)
{
  const Scene scene = scene_load(file);
  for (const Instance& instance : scene.instances) {
    const Mesh& mesh = scene.meshes[static_cast<std::size_t>(instance.mesh_index)];
    if (mesh.triangles.empty() || !mesh.radius.empty()) continue;
    if (mesh.uv[0].empty()) {
      throw InputError(file, "mesh '" + mesh.name + "': expected texture coordinates (TEXCOORD_0), found none");
    }
    const Affine3& m = instance.world_from_object;
    const auto first = static_cast<std::uint32_t>(out.P.size());
    for (const Vec3f P : mesh.P) out.P.push_back(transform_point(m, P));
    out.uv.insert(out.uv.end(), mesh.uv[0].begin(), mesh.uv[0].end());
    const Affine3 object_from_world = inverse(m);
    const bool is_mirrored = determinant(m) < 0;
    std::vector<TriangleIndices> triangles = mesh.triangles;
    for (TriangleIndices& t : triangles) {
      if (is_mirrored) std::swap(t.v1, t.v2);
    }
    if (mesh.N.empty()) {
      const std::vector<Vec3f> placed(out.P.begin() + first, out.P.end());
      const std::vector<Normal3f> N = smooth_normals(placed, triangles);
      out.N.insert(out.N.end(), N.begin(), N.end());
    } else {
      for (const Normal3f N : mesh.N) {
        const Vec3f n = normalize(transform_normal(object_from_world, N));
        out.N.push_back({n.x, n.y, n.z});
      }
    }
    for (const TriangleIndices& t : triangles) out.triangles.push_back({first + t.v0, first + t.v1, first + t.v2});
  }
  if (out.triangles.empty()) throw InputError(file, "expected triangles, found none");
}

HeightMap height_map_of(const std::string& file)
{
  TextureRequest request;
  request.file = file;
  request.label = request.scene_file = file;
  Warnings warnings;
  return height_maps_load(std::span(&request, 1), warnings).maps.front();
}

}  // namespace

bool OwnScene::is_obj(const std::string& file)
{
  std::string suffix = std::filesystem::path(file).extension().string();
  for (char& c : suffix) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  if (suffix != ".obj" && suffix != ".gltf" && suffix != ".glb") {
    throw InputError(file, "expected a mesh whose name ends in .obj, .gltf or .glb");
  }
  return suffix == ".obj";
}

OwnScene::OwnScene(const OwnSceneFiles& files) : name_(std::filesystem::path(files.mesh).filename().string())
{
  if (is_obj(files.mesh)) {
    ObjMesh mesh = obj_load(files.mesh);
    scene_.P = std::move(mesh.P);
    scene_.N = mesh.N.empty() ? smooth_normals(scene_.P, mesh.triangles) : std::move(mesh.N);
    scene_.uv = std::move(mesh.uv);
    scene_.triangles = std::move(mesh.triangles);
  } else {
    append_meshes(files.mesh, scene_);
  }
  scene_.height_map = height_map_of(files.map);
  scene_.midlevel = files.midlevel;
  bench_scene_measure_texels(scene_);
  if (!std::isfinite(scene_.texel_metres) || !(scene_.texel_metres > 0)) {
    throw InputError(files.mesh, "expected triangles and texture coordinates with an area, found none");
  }

  spec_.name = name_;
  spec_.scale = files.scale;
  spec_.tiles_u = spec_.tiles_v = files.tiles;
  spec_.field_of_view = 25;
  Vec3d low{HUGE_VAL, HUGE_VAL, HUGE_VAL}, high = low * -1.0;
  for (const Vec3f P : scene_.P) {
    const Vec3d p = to_double(P);
    low = {std::min(low.x, p.x), std::min(low.y, p.y), std::min(low.z, p.z)};
    high = {std::max(high.x, p.x), std::max(high.y, p.y), std::max(high.z, p.z)};
  }
  // A ball around the box, with what heights may add, fills the picture.
  const double radius = 0.5 * length(high - low) + std::abs(files.scale);
  const double distance = radius / std::sin(0.5 * spec_.field_of_view * M_PI / 180);
  const Vec3d middle = (low + high) * 0.5,
              towards = Vec3d{0.37, 0.33, 0.87} * (distance / length(Vec3d{0.37, 0.33, 0.87}));
  const Vec3d eye = middle + towards;
  std::copy_n(std::array{eye.x, eye.y, eye.z}.begin(), 3, spec_.eye);
  std::copy_n(std::array{middle.x, middle.y, middle.z}.begin(), 3, spec_.look_at);
}

BenchScene OwnScene::make(const BenchSceneChange& change) const
{
  BenchScene scene = scene_;
  scene.spec = &spec_;
  scene.scale = spec_.scale * change.scale;
  scene.tiles_u = scene.tiles_v = spec_.tiles_u * change.tiling;
  for (Vec2f& uv : scene.uv) {
    uv = {static_cast<float>(uv.x * scene.tiles_u), static_cast<float>(uv.y * scene.tiles_v)};
  }
  bench_scene_measure_texels(scene);
  return scene;
}

}  // namespace relief
