// Scenes put together in code, for tests of the integrator that want a known answer and no file.
#pragma once

#include <cmath>
#include <cstdint>
#include <memory>
#include <random>
#include <utility>
#include <vector>

#include "scene/scene.h"
#include "scene/texture_store.h"

namespace relief::test {

/// A grey Lambertian without any specular reflection.
inline Material diffuse_material(Vec3f color)
{
  Material m;
  m.base_color = color;
  m.metallic = 0;
  m.roughness = 1;
  m.specular = 0;
  return m;
}

/// Latitude–longitude sphere around the origin, counter-clockwise from outside.
inline Mesh sphere_mesh(float radius, int columns, int rows, bool smooth)
{
  Mesh mesh;
  for (int r = 0; r <= rows; ++r) {
    for (int c = 0; c <= columns; ++c) {
      const float theta = kPi * static_cast<float>(r) / static_cast<float>(rows);
      const float phi = 2 * kPi * static_cast<float>(c) / static_cast<float>(columns);
      const Vec3f n{std::sin(theta) * std::cos(phi), std::cos(theta), -std::sin(theta) * std::sin(phi)};
      mesh.P.push_back(n * radius);
      if (smooth) mesh.N.push_back(as_normal(n));
    }
  }
  const auto at = [&](int r, int c) { return static_cast<std::uint32_t>(r * (columns + 1) + c); };
  for (int r = 0; r < rows; ++r) {
    for (int c = 0; c < columns; ++c) {
      if (r > 0) mesh.triangles.push_back({at(r, c), at(r + 1, c), at(r, c + 1)});
      if (r + 1 < rows) mesh.triangles.push_back({at(r, c + 1), at(r + 1, c), at(r + 1, c + 1)});
    }
  }
  return mesh;
}

/// Parallelogram with corner P and edges u, v; its front is on the side of u × v.
inline Mesh quad_mesh(Vec3f P, Vec3f u, Vec3f v)
{
  Mesh mesh;
  mesh.P = {P, P + u, P + u + v, P + v};
  mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
  return mesh;
}

/// An empty scene with one default camera on +Z looking at the origin.
inline Scene empty_scene()
{
  Scene scene;
  scene.file = "test";
  Warnings warnings;
  scene.textures = std::make_shared<TextureStore>(std::vector<TextureRequest>{}, 0, warnings);
  SceneCamera camera;
  camera.name = "camera";
  camera.camera.world_from_camera.p = {0, 0, 4};
  camera.camera.half_width = camera.camera.half_height = 0.4f;
  scene.cameras.push_back(camera);
  scene.render.filter = PixelFilter::kBox;
  scene.render.filter_width = 1;
  return scene;
}

/// Adds a mesh with a material of its own and one instance of it.
/// Fills the meshes of a material, which is to be added next, with what absorbs.
/// @param sigma_a  1/m
inline void set_absorption(Scene& scene, Material& material, Vec3f sigma_a)
{
  material.medium_index = static_cast<int>(scene.media.size());
  scene.media.emplace_back().sigma_t = sigma_a;
}

inline void add_object(Scene& scene, Mesh mesh, const Material& material, const Affine3& world_from_object = {})
{
  const int index = static_cast<int>(scene.materials.size());
  scene.materials.push_back(material);
  scene.material_names.push_back("material " + std::to_string(index));
  mesh.material_index = index;
  scene.meshes.push_back(std::move(mesh));
  Instance instance;
  instance.mesh_index = static_cast<int>(scene.meshes.size()) - 1;
  instance.material_index = index;
  instance.world_from_object = world_from_object;
  if (determinant(world_from_object) < 0) instance.flags |= kMirrored;
  scene.instances.push_back(instance);
}

/// Adds a square height map and what displaces by it, as displacement and texture 0, 1, … of the scene.
/// @param texels  16 bit, size² of them, the upper row first
/// @param scale   metres from black to white
inline DisplacementSettings& add_displacement(Scene& scene, int size, std::vector<std::uint16_t> texels, float scale)
{
  const auto owned = std::make_shared<const std::vector<std::uint16_t>>(std::move(texels));
  HeightMap map;
  map.label = "made by a test";
  map.width = map.height = size;
  map.texels = std::shared_ptr<const void>(owned, owned->data());
  scene.height_maps.push_back(map);
  DisplacementSettings settings;
  settings.height.texture_index = static_cast<std::int32_t>(scene.height_maps.size()) - 1;
  settings.scale = scale;
  scene.displacements.push_back(settings);
  return scene.displacements.back();
}

/// Texels of noise.
inline std::vector<std::uint16_t> noise_texels(int size, unsigned seed)
{
  std::mt19937 random(seed);
  std::vector<std::uint16_t> texels(static_cast<std::size_t>(size) * static_cast<std::size_t>(size));
  for (std::uint16_t& texel : texels) texel = static_cast<std::uint16_t>(random());
  return texels;
}

}  // namespace relief::test
