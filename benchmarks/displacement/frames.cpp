#include "benchmarks/displacement/frames.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <memory>

#include <tbb/task_arena.h>

#include "integrator/render.h"
#include "scene/texture_store.h"

namespace relief {

namespace {

/// The benchmark's scene as the renderer takes it.
Scene render_scene(const BenchScene& bench)
{
  Scene scene;
  scene.file = "bench";
  Warnings warnings;
  scene.textures = std::make_shared<TextureStore>(std::vector<TextureRequest>{}, 0, warnings);
  Mesh mesh;
  mesh.name = bench.spec->name;
  mesh.P = bench.P;
  mesh.N = bench.N;
  mesh.uv[0] = bench.uv;
  mesh.triangles = bench.triangles;
  scene.meshes.push_back(std::move(mesh));

  Material material;
  material.base_color = {0.6f, 0.6f, 0.6f};
  material.metallic = 0;
  material.roughness = 1;
  material.specular = 0;
  material.displacement_index = 0;
  scene.materials.push_back(material);
  scene.material_names.emplace_back("grey");
  scene.instances.emplace_back();

  scene.height_maps.push_back(bench.height_map);
  DisplacementSettings displacement;
  displacement.height.texture_index = 0;
  displacement.scale = static_cast<float>(bench.scale);
  displacement.midlevel = static_cast<float>(bench.midlevel);
  scene.displacements.push_back(displacement);

  Light sun;
  sun.kind = LightKind::kSun;
  sun.axis = -kBenchSun;
  sun.emission = {3, 3, 3};
  scene.lights.push_back(sun);
  scene.environment.color = {0.4f, 0.4f, 0.4f};
  return scene;
}

Camera render_camera(const BenchSceneSpec& spec, BenchResolution resolution)
{
  const BenchCamera from = bench_camera(spec);
  Camera camera;
  camera.world_from_camera = {from.right, from.up, -from.forward, from.eye};
  camera.half_height = from.half_height;
  camera.half_width = from.half_height * static_cast<float>(resolution.width) / static_cast<float>(resolution.height);
  return camera;
}

/// Beauty of all pixels.
std::vector<Vec3f> radiances(const RenderedImage& image)
{
  const FilmView& v = image.view;
  std::vector<Vec3f> values;
  for (int k = 0; k < v.width * v.height; ++k) {
    const float* p = v.pixels + k * v.layout.num_floats + v.layout.offset[static_cast<std::size_t>(Aov::kBeauty)];
    values.push_back({p[0], p[1], p[2]});
  }
  return values;
}

double relative_difference(const std::vector<Vec3f>& a, const std::vector<Vec3f>& b)
{
  double squares = 0, sum = 0;
  for (std::size_t k = 0; k < a.size(); ++k) {
    const Vec3d difference = to_double(a[k]) - to_double(b[k]);
    squares += dot(difference, difference) / 3;
    sum += (static_cast<double>(b[k].x) + b[k].y + b[k].z) / 3;
  }
  const auto count = static_cast<double>(a.size());
  return sum > 0 ? std::sqrt(squares / count) / (sum / count) : 0;
}

}  // namespace

std::vector<FrameResult> bench_frames(const BenchScene& bench,
                                      BenchResolution resolution,
                                      int rounds,
                                      std::uint64_t tessellation_bytes)
{
  const Scene scene = render_scene(bench);
  const BenchResolution half{std::max(1, resolution.width / 2), std::max(1, resolution.height / 2)};
  RenderOptions options;
  options.settings = scene.render;
  options.settings.width = half.width;
  options.settings.height = half.height;
  options.settings.samples = 4;
  options.settings.max_bounces = 4;
  options.camera = render_camera(*bench.spec, half);
  options.displacement.tessellation_bytes = tessellation_bytes;

  const BenchSurface surface(bench);
  std::vector<FrameResult> results;
  std::vector<Vec3f> expected;
  for (const DisplacementMethod method : kDisplacementMethods) {
    FrameResult result;
    result.scene = bench.spec->name;
    result.method = displacement_method_label(method);
    options.displacement.method = method;
    const std::optional<TessellationKind> kind = displacement_method(method).tessellation;
    if (kind) {
      result.rate = tessellation_rate_within(surface.mesh.view(), *kind, kRenderTessellation, tessellation_bytes);
      options.displacement.tessellation_rate = result.rate;
    }
    // A tessellation takes far longer to build than a frame to render; it is not built again.
    const int num_frames = kind ? 1 : rounds;
    for (int round = 0; round < num_frames; ++round) {
      Statistics stats;
      RenderedImage image;
      tbb::task_arena(1).execute([&] {
        const std::atomic<bool> stop{false};
        image = render(scene, options, stop, {}, stats);
      });
      if (round == 0) {
        result.build_seconds = stats.build_seconds;
        result.bytes = stats.displacement.bytes + stats.bvh_bytes;
        result.num_rays = stats.counters.camera_rays + stats.counters.bounce_rays + stats.counters.shadow_rays;
        const std::vector<Vec3f> found = radiances(image);
        if (expected.empty()) expected = found;
        result.difference = relative_difference(found, expected);
      }
      result.render_seconds = round == 0 ? stats.render_seconds : std::min(result.render_seconds, stats.render_seconds);
    }
    results.push_back(result);
  }
  return results;
}

}  // namespace relief
