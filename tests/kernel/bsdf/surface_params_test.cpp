// From material and textures to the parameters of a point; normal maps.
#include <gtest/gtest.h>

#include "tests/kernel/bsdf/bsdf_fixture.h"
#include "tests/support/chi2.h"

namespace relief {
namespace {

constexpr float kNoWidth[2] = {0, 0};
constexpr Vec2f kUv[2] = {{0.5f, 0.5f}, {0.25f, 0.75f}};

/// One-texel texture of a constant colour.
struct ConstantTexture {
  unsigned char texel[4];
  TextureView view;

  ConstantTexture(int r, int g, int b, int a)
      : texel{static_cast<unsigned char>(r), static_cast<unsigned char>(g), static_cast<unsigned char>(b),
              static_cast<unsigned char>(a)}
  {
    view.levels[0] = texel;
    view.width = view.height = view.num_levels = 1;
    view.num_channels = 4;
  }
  ConstantTexture(const ConstantTexture&) = delete;
  ConstantTexture& operator=(const ConstantTexture&) = delete;
};

TEST(SurfaceParams, AreConstantsTimesTextures)
{
  const ConstantTexture texture(51, 102, 153, 204);  // 0.2, 0.4, 0.6, 0.8
  const TextureRef ref{0, 1};
  Material m;
  m.base_color = {0.5f, 0.5f, 0.5f};
  m.base_alpha = 0.5f;
  m.alpha_mode = AlphaMode::kBlend;
  m.base_color_texture = m.metallic_roughness_texture = m.transmission_texture = m.clearcoat_texture = ref;
  m.clearcoat_roughness_texture = m.sheen_color_texture = m.sheen_roughness_texture = ref;
  m.specular_texture = m.specular_color_texture = m.emission_texture = ref;
  m.transmission = m.clearcoat = m.clearcoat_roughness = m.sheen_roughness = 1;
  m.sheen_color = {1, 1, 1};
  m.emission = {10, 10, 10};
  const SurfaceParams p = surface_params_eval<kFeatureAll>(m, &texture.view, kUv, {1, 0.5f, 1, 0.5f}, kNoWidth);
  EXPECT_NEAR(p.base_color.x, 0.1f, 1e-6f);
  EXPECT_NEAR(p.base_color.y, 0.1f, 1e-6f);
  EXPECT_NEAR(p.base_color.z, 0.3f, 1e-6f);
  EXPECT_NEAR(p.alpha, 0.5f * 0.8f * 0.5f, 1e-6f);
  EXPECT_NEAR(p.roughness, 0.4f, 1e-6f);
  EXPECT_NEAR(p.metallic, 0.6f, 1e-6f);
  EXPECT_NEAR(p.transmission, 0.2f, 1e-6f);
  EXPECT_NEAR(p.clearcoat, 0.2f, 1e-6f);
  EXPECT_NEAR(p.clearcoat_roughness, 0.4f, 1e-6f);
  EXPECT_NEAR(p.sheen_color.z, 0.6f, 1e-6f);
  EXPECT_NEAR(p.sheen_roughness, 0.8f, 1e-6f);
  EXPECT_NEAR(p.specular, 0.8f, 1e-6f);
  EXPECT_NEAR(p.specular_color.y, 0.4f, 1e-6f);
  EXPECT_NEAR(p.emission.x, 2.0f, 1e-5f);
}

TEST(SurfaceParams, AlphaModes)
{
  Material m;
  m.base_alpha = 0.4f;
  const auto alpha = [&m] { return surface_params_eval<kFeatureAll>(m, nullptr, kUv, {1, 1, 1, 1}, kNoWidth).alpha; };
  EXPECT_EQ(alpha(), 1.0f);
  m.alpha_mode = AlphaMode::kMask;
  EXPECT_EQ(alpha(), 0.0f);
  m.alpha_cutoff = 0.4f;
  EXPECT_EQ(alpha(), 1.0f);
  m.alpha_mode = AlphaMode::kBlend;
  EXPECT_EQ(alpha(), 0.4f);
}

TEST(SurfaceParams, UnlitMaterialsEmitTheirBaseColor)
{
  Material m;
  m.unlit = true;
  m.base_color = {0.2f, 0.4f, 0.6f};
  const SurfaceParams p = surface_params_eval<kFeatureAll>(m, nullptr, kUv, {1, 1, 1, 1}, kNoWidth);
  EXPECT_TRUE(p.unlit);
  EXPECT_EQ(p.emission, m.base_color);
  EXPECT_EQ(surface_albedo(p), m.base_color);
}

TEST(SurfaceParams, GlassWithThicknessIsSolid)
{
  Material m;
  m.transmission = 1;
  m.thickness = 1;
  EXPECT_FALSE((surface_params_eval<kFeatureAll>(m, nullptr, kUv, {1, 1, 1, 1}, kNoWidth).thin));
  m.thickness = 0;
  EXPECT_TRUE((surface_params_eval<kFeatureAll>(m, nullptr, kUv, {1, 1, 1, 1}, kNoWidth).thin));
}

TEST(FeatureMask, NamesWhatAMaterialUses)
{
  Material m;
  m.metallic = 0;
  EXPECT_EQ(feature_mask_of(m), 0u);
  m.metallic = 1;
  m.transmission = 0.5f;
  m.clearcoat = 0.1f;
  m.alpha_mode = AlphaMode::kMask;
  m.normal_texture.texture_index = 3;
  EXPECT_EQ(feature_mask_of(m), kFeatureAll & ~static_cast<unsigned>(kFeatureTextures));
  m.emission_texture.texture_index = 0;
  EXPECT_EQ(feature_mask_of(m), kFeatureAll);
}

TEST(NormalMap, DecodesAndScales)
{
  const ConstantTexture texture(255, 0, 255, 255);  // (1, −1, 1)
  const TextureRef ref{0, 0};
  const Vec3f n = normal_map_eval(ref, 0.5f, &texture.view, kUv);
  const Vec3f expected = normalize({0.5f, -0.5f, 1.0f});
  EXPECT_LT(length(n - expected), 1e-6f);
  EXPECT_EQ(normal_map_eval(TextureRef{}, 1.0f, nullptr, kUv), (Vec3f{0, 0, 1}));
}

TEST(NormalMap, NeverPointsIntoTheSurface)
{
  const ConstantTexture inward(127, 127, 0, 255), nothing(128, 128, 128, 255);
  for (const ConstantTexture* texture : {&inward, &nothing}) {
    const Vec3f n = normal_map_eval(TextureRef{0, 0}, 1.0f, &texture->view, kUv);
    EXPECT_GT(n.z, 0.0f);
    EXPECT_NEAR(length(n), 1.0f, 1e-6f);
  }
}

// A million random pairs of normals and viewers, grazing ones included.
TEST(ShadingNormalConsistent, ReflectsAboveTheSurface)
{
  TestRandom random(1);
  for (int n = 0; n < 1000000; ++n) {
    const Vec3f Ng = warp_sphere({random.next(), random.next()});
    const Vec3f Ns = warp_sphere({random.next(), random.next()});
    Vec3f wo = warp_sphere({random.next(), random.next()});
    if (n % 3 == 0) wo = normalize(wo - Ng * (dot(wo, Ng) * 0.999f));
    if (dot(wo, Ng) < 0.0f) wo = -wo;
    if (!(dot(wo, Ng) > 1e-5f)) continue;
    const Vec3f N = shading_normal_consistent(Ng, Ns, wo);
    const Vec3f reflected = 2.0f * dot(N, wo) * N - wo;
    ASSERT_NEAR(length(N), 1.0f, 1e-5f) << n;
    ASSERT_GT(dot(N, wo), 0.0f) << n;
    ASSERT_GT(dot(reflected, Ng), -1e-6f) << n;
  }
}

TEST(ShadingNormalConsistent, LeavesGoodNormalsAlone)
{
  const Vec3f Ng{0, 0, 1};
  const Vec3f Ns = normalize({0.2f, 0.1f, 1.0f});
  EXPECT_EQ(shading_normal_consistent(Ng, Ns, normalize({0.3f, 0.0f, 1.0f})), Ns);
  EXPECT_EQ(shading_normal_consistent(Ng, Ng, normalize({1.0f, 0.0f, 1e-4f})), Ng);
}

// The bend is continuous: a normal just past the limit changes little.
TEST(ShadingNormalConsistent, IsContinuousAtTheLimit)
{
  const Vec3f Ng{0, 0, 1};
  const Vec3f wo = normalize({0.8f, 0.0f, 0.6f});
  Vec3f previous = shading_normal_consistent(Ng, normalize({0.0f, 0.1f, 1.0f}), wo);
  for (float tilt = 0.0f; tilt < 1.0f; tilt += 1e-3f) {
    const Vec3f N = shading_normal_consistent(Ng, normalize({-tilt, 0.1f, 1.0f}), wo);
    ASSERT_LT(length(N - previous), 5e-3f) << tilt;
    previous = N;
  }
}

}  // namespace
}  // namespace relief
