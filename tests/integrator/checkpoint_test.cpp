// A render that goes on from a checkpoint, wherever it was taken, is the render that was never ended.
#include "integrator/checkpoint.h"

#include <algorithm>
#include <cstring>
#include <functional>

#include <tbb/global_control.h>
#include <tbb/task_arena.h>

#include "tests/support/caustic_scene.h"
#include "tests/support/render_scene.h"
#include "tests/support/scene_builder.h"

namespace relief::test {
namespace {

/// Spheres of glass and metal and a see-through pane on a displaced floor: first hits in all orders.
Scene checkpoint_scene()
{
  Scene scene = empty_scene();
  add_displacement(scene, 8, noise_texels(8, 1), 0.3f);
  Material ground = diffuse_material({0.6f, 0.5f, 0.4f});
  ground.displacement_index = 0;
  Mesh floor = quad_mesh({-5, -1, -5}, {0, 0, 10}, {10, 0, 0});
  floor.uv[0] = {{0, 0}, {1, 0}, {1, 1}, {0, 1}};
  add_object(scene, floor, ground);
  add_caster(scene, sphere_mesh(0.5f, 24, 12, true), glass_material());
  Material pane = diffuse_material({0.1f, 0.2f, 0.8f});
  pane.alpha_mode = AlphaMode::kBlend;
  pane.base_alpha = 0.4f;
  add_object(scene, quad_mesh({-1.2f, -0.8f, 0.6f}, {0.8f, 0, 0}, {0, 1.2f, 0}), pane);
  scene.lights.push_back(point_light({0, 2, 1}, 5));
  scene.environment.color = {0.2f, 0.25f, 0.3f};
  return scene;
}

struct Interrupted {
  std::vector<SavedRender> saved;
  RenderedImage image;
};

/// Renders with checkpoints as close as can be.
/// @param stop_at  checkpoint at which the render is stopped
Interrupted render_interrupted(const Scene& scene, RenderOptions options, std::size_t stop_at)
{
  Interrupted result;
  std::atomic<bool> stop{false};
  options.checkpoint_seconds = 1e-9;
  options.checkpoint = [&](const RenderState& state, std::span<const float> sums, const FilmView& film) {
    result.saved.push_back({state, film.width, film.height, {sums.begin(), sums.end()}});
    if (result.saved.size() == stop_at) stop = true;
  };
  Statistics stats;
  result.image = render(scene, options, stop, {}, stats);
  return result;
}

Rendered render_from(const Scene& scene, RenderOptions options, SavedRender saved, int threads)
{
  const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, static_cast<std::size_t>(threads));
  tbb::task_arena arena(threads);
  options.saved = &saved;
  return arena.execute([&] { return render_scene(scene, options); });
}

void expect_same_bits(const Rendered& a, const Rendered& b, const std::string& what)
{
  ASSERT_EQ(a.image.pixels.size(), b.image.pixels.size());
  EXPECT_EQ(std::memcmp(a.image.pixels.data(), b.image.pixels.data(), a.image.pixels.size() * sizeof(float)), 0)
      << what;
  EXPECT_EQ(a.stats.samples_per_pixel, b.stats.samples_per_pixel) << what;
  EXPECT_EQ(a.stats.counters.camera_rays, b.stats.counters.camera_rays) << what;
  EXPECT_TRUE(b.stats.warnings.empty()) << what;
}

TEST(Checkpoint, WhereverItIsTakenTheRenderThatGoesOnHasTheSameBits)
{
  const Scene scene = checkpoint_scene();
  const std::pair<const char*, std::function<void(RenderOptions&)>> kCases[] = {
      {"plain", [](RenderOptions&) {}},
      {"adaptive", [](RenderOptions& o) { o.settings.noise_threshold = 0.05f; }},
      {"caustics",
       [](RenderOptions& o) {
         o.settings.caustics.mode = CausticsMode::kOn, o.settings.caustics.photons = 1000, o.settings.samples = 20;
       }},
      {"few tiles with photons",
       [](RenderOptions& o) {
         o.settings.caustics.mode = CausticsMode::kOn, o.settings.caustics.photons = 1000;
         o.settings.noise_threshold = 0.05f;
       }},
      {"crop", [](RenderOptions& o) { o.crop_x0 = 5, o.crop_y0 = 7, o.crop_x1 = 50, o.crop_y1 = 40; }}};
  for (const auto& [name, change] : kCases) {
    RenderOptions options = render_options(scene, 64, 40);
    options.settings.caustics.mode = CausticsMode::kOff;
    change(options);
    const Rendered whole = render_scene(scene, options);
    const Interrupted all = render_interrupted(scene, options, 0);
    ASSERT_GE(all.saved.size(), 4u) << name;
    EXPECT_FALSE(all.image.saved) << "a finished picture has no state";
    EXPECT_EQ(
        std::memcmp(whole.image.pixels.data(), all.image.pixels.data(), whole.image.pixels.size() * sizeof(float)), 0)
        << name << ": checkpoints change nothing";
    bool is_within_a_pass = false;
    const std::size_t last = all.saved.size() - 1;
    for (const std::size_t i : {std::size_t{0}, last / 3, 2 * last / 3, last}) {
      const RenderState& state = all.saved[i].state;
      for (const int tile : state.active)
        is_within_a_pass |= state.tile_samples[static_cast<std::size_t>(tile)] != state.done_samples;
      expect_same_bits(whole, render_from(scene, options, all.saved[i], 1 + static_cast<int>(i % 2)),
                       name + std::string(" from checkpoint ") + std::to_string(i));
    }
    EXPECT_TRUE(is_within_a_pass) << name;
    // At the first: how many there are depends on the time that each of them takes.
    const Interrupted stopped = render_interrupted(scene, options, 1);
    ASSERT_TRUE(stopped.image.saved) << name;
    expect_same_bits(whole, render_from(scene, options, *stopped.image.saved, 2), name + std::string(" interrupted"));
  }
}

TEST(Checkpoint, WhatIsOfAnotherFilmIsNotPutBack)
{
  const Scene scene = checkpoint_scene();
  RenderOptions options = render_options(scene, 32, 20);
  options.settings.caustics.mode = CausticsMode::kOff;
  const SavedRender good = render_interrupted(scene, options, 1).saved.at(0);
  const Rendered whole = render_scene(scene, options);
  const std::pair<const char*, std::function<void(SavedRender&)>> kBad[] = {
      {"size", [](SavedRender& s) { std::swap(s.width, ++s.height); }},
      {"sums", [](SavedRender& s) { s.sums.pop_back(); }},
      {"tiles", [](SavedRender& s) { s.state.tile_samples.push_back(0); }},
      {"no pass", [](SavedRender& s) { s.state.pass_samples = 0; }},
      {"long pass", [](SavedRender& s) { s.state.pass_samples = 21; }},
      {"pass beyond a batch",
       [](SavedRender& s) {
         s.state.pass_samples = kMostPassSamples + 1;
         std::replace(s.state.tile_samples.begin(), s.state.tile_samples.end(), kMostPassSamples, kMostPassSamples + 1);
       }},
      {"finished", [](SavedRender& s) { s.state.done_samples = 20; }},
      {"no tile", [](SavedRender& s) { s.state.active.clear(); }},
      {"tile beyond", [](SavedRender& s) { s.state.active[0] = 4; }},
      {"tile before", [](SavedRender& s) { s.state.active[0] = -1; }},
      {"tile twice", [](SavedRender& s) { s.state.active[1] = s.state.active[0]; }},
      {"tile of another pass", [](SavedRender& s) { s.state.tile_samples[0] = 3; }},
      {"too many samples", [](SavedRender& s) { s.state.tile_samples[0] = 1u << 31; }}};
  for (const auto& [name, damage] : kBad) {
    SavedRender bad = good;
    damage(bad);
    const Rendered anew = render_from(scene, options, bad, 2);
    EXPECT_EQ(
        std::memcmp(whole.image.pixels.data(), anew.image.pixels.data(), whole.image.pixels.size() * sizeof(float)), 0)
        << name;
    ASSERT_EQ(anew.stats.warnings.size(), 1u) << name;
    EXPECT_NE(anew.stats.warnings[0].find("begun anew"), std::string::npos) << name;
  }
}

}  // namespace
}  // namespace relief::test
