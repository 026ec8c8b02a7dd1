// Which images (AOVs) a render keeps and where each lies in a pixel's record. One list serves the film, the command
// line, the EXR writer and the documentation.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>

namespace relief {

enum class Aov : std::uint8_t {
  kBeauty,
  kDirect,
  kIndirect,
  kAlbedo,
  kNormal,
  kDepth,
  kPosition,
  kUv,
  kObjectId,
  kMaterialId,
  kSampleCount,
  kVariance,
  kHalf,
  kDisplacementSteps,
  kCaustic,
  kHoldout,
  kShadowCatcher,
  kMist,
  kEmission,
  kEnvironment,
  kAmbientOcclusion,
  kDenoisingAlbedo,
  kDenoisingNormal,
  kDenoisingDepth,
  kDenoisingHalf,
  kVolumeDirect,
  kVolumeIndirect,
  kLightGroups,
  kDiffuseDirect,
  kDiffuseIndirect,
  kDiffuseColor,
  kGlossyDirect,
  kGlossyIndirect,
  kGlossyColor,
  kTransmissionDirect,
  kTransmissionIndirect,
  kTransmissionColor,
  kCryptoObject,
  kCryptoMaterial,
  kCryptoAsset,
};
inline constexpr int kNumAovs = 40;

/// Sets of AOVs: bit i is enumerator i.
using AovMask = std::uint64_t;
inline constexpr AovMask kAllAovs = (AovMask{1} << kNumAovs) - 1;
constexpr AovMask aov_bit(Aov aov) { return AovMask{1} << static_cast<int>(aov); }
constexpr bool aov_is_in(Aov aov, AovMask mask) { return (mask & aov_bit(aov)) != 0; }

/// What an event at a surface counts as in the layers that tell light apart by it: scattered diffusely, reflected, refracted.
enum class EventKind : std::uint8_t { kDiffuse, kGlossy, kTransmission };
inline constexpr int kNumEventKinds = 3;

/// Layers of light by the first event: direct and indirect, of each kind.
inline constexpr int kNumLightPasses = 2 * kNumEventKinds;
constexpr int light_pass(EventKind kind, bool is_indirect)
{
  return 2 * static_cast<int>(kind) + (is_indirect ? 1 : 0);
}

/// They follow one another in Aov: direct, indirect and colour of each kind.
constexpr Aov light_pass_aov(int pass)
{
  return static_cast<Aov>(static_cast<int>(Aov::kDiffuseDirect) + pass / 2 * 3 + pass % 2);
}
constexpr Aov event_color_aov(int kind) { return static_cast<Aov>(static_cast<int>(Aov::kDiffuseColor) + 3 * kind); }

/// The three Cryptomattes, which follow one another in Aov.
inline constexpr int kNumCryptomattes = 3;
inline constexpr int kFirstCryptomatte = static_cast<int>(Aov::kCryptoObject);

/// Ids that a Cryptomatte keeps of a pixel.
inline constexpr int kMostCryptomatteLevels = 16;

struct AovInfo {
  Aov aov;
  std::string_view name;      ///< command line and EXR layer name
  std::string_view channels;  ///< one letter a channel; empty: a Cryptomatte, which has as many as its levels ask for
  bool integer_like;          ///< ids and counts: never stored as half, never averaged
  std::string_view meaning;
};

inline constexpr std::array<AovInfo, kNumAovs> kAovInfo = {{
    {Aov::kBeauty, "beauty", "RGBA", false,
     "radiance; A = coverage by geometry, and by media as far as they let no light through"},
    {Aov::kDirect, "direct", "RGB", false, "light after at most one scattering event, emission seen directly included"},
    {Aov::kIndirect, "indirect", "RGB", false, "light after two or more scattering events"},
    {Aov::kAlbedo, "albedo", "RGB", false, "base colour of the first non-transparent hit"},
    {Aov::kNormal, "normal", "XYZ", false,
     "unit shading normal of the first hit with its bumps, world space, averaged"},
    {Aov::kDepth, "depth", "Z", false, "distance along the camera's axis, metres, averaged over samples that hit"},
    {Aov::kPosition, "position", "XYZ", false, "first hit, world space, metres, averaged over samples that hit"},
    {Aov::kUv, "uv", "UV", false, "texture coordinates (set 0) of the first hit, averaged"},
    {Aov::kObjectId, "object_id", "I", true, "instance index + 1 of the pixel's first sample; 0 = background"},
    {Aov::kMaterialId, "material_id", "I", true, "material index + 1 of the pixel's first sample; 0 = background"},
    {Aov::kSampleCount, "samples", "N", true, "samples taken in this pixel"},
    {Aov::kVariance, "variance", "RGB", false, "estimated variance of the pixel's mean radiance"},
    {Aov::kHalf, "half", "RGB", false, "mean of the pixel's even-numbered samples"},
    {Aov::kDisplacementSteps, "displacement_steps", "N", false,
     "bounds and texels of displaced meshes tested for a camera ray, averaged"},
    {Aov::kCaustic, "caustic", "RGB", false, "light that the photon pass brought; part of indirect"},
    {Aov::kHoldout, "holdout", "A", false, "share of the samples that met a holdout, where the picture has a hole"},
    {Aov::kShadowCatcher, "shadow_catcher", "RGB", false,
     "what the scene leaves of the light on shadow catchers; 1 elsewhere. Beauty then shows neither them nor shadows"},
    {Aov::kMist, "mist", "Z", false, "0 at RELIEF_render's mist.start … 1 at its end and where nothing is met"},
    {Aov::kEmission, "emission", "RGB", false, "what surfaces and lights send straight to the camera"},
    {Aov::kEnvironment, "environment", "RGB", false, "the surroundings where the camera meets them, shown or not"},
    {Aov::kAmbientOcclusion, "ambient_occlusion", "Y", false,
     "share of the hemisphere over the first hit that is open up to RELIEF_render's occlusionDistance"},
    {Aov::kDenoisingAlbedo, "denoising_albedo", "RGB", false,
     "base colour and emission of the first hit that is no mirror or glass, times what those on the way take"},
    {Aov::kDenoisingNormal, "denoising_normal", "XYZ", false,
     "shading normal of the same hit along the camera's axes: right, up, and into the picture"},
    {Aov::kDenoisingDepth, "denoising_depth", "Z", false,
     "distance of the first hit from the camera, metres, averaged with 0 for none"},
    {Aov::kDenoisingHalf, "denoising_half", "RGBXYZD", false,
     "the three layers above, of the pixel's even-numbered samples"},
    {Aov::kVolumeDirect, "volume_direct", "RGB", false,
     "light that media scatter to the camera, straight from its source"},
    {Aov::kVolumeIndirect, "volume_indirect", "RGB", false,
     "light that media scatter to the camera after other scattering events"},
    {Aov::kLightGroups, "light_groups", "RGB", false,
     "light of the scene's groups of lights, a layer each: light_group_NAME"},
    {Aov::kDiffuseDirect, "diffuse_direct", "RGB", false,
     "light that what the camera sees scatters diffusely, straight from its source"},
    {Aov::kDiffuseIndirect, "diffuse_indirect", "RGB", false, "the same, after other scattering events"},
    {Aov::kDiffuseColor, "diffuse_color", "RGB", false, "share of light that what the camera sees scatters diffusely"},
    {Aov::kGlossyDirect, "glossy_direct", "RGB", false,
     "light that what the camera sees reflects, straight from its source"},
    {Aov::kGlossyIndirect, "glossy_indirect", "RGB", false, "the same, after other scattering events"},
    {Aov::kGlossyColor, "glossy_color", "RGB", false, "share of light that what the camera sees reflects"},
    {Aov::kTransmissionDirect, "transmission_direct", "RGB", false,
     "light that what the camera sees refracts, straight from its source"},
    {Aov::kTransmissionIndirect, "transmission_indirect", "RGB", false, "the same, after other scattering events"},
    {Aov::kTransmissionColor, "transmission_color", "RGB", false, "share of light that what the camera sees refracts"},
    {Aov::kCryptoObject, "crypto_object", "", false, "Cryptomatte of the nodes' names"},
    {Aov::kCryptoMaterial, "crypto_material", "", false, "Cryptomatte of the materials' names"},
    {Aov::kCryptoAsset, "crypto_asset", "", false, "Cryptomatte of RELIEF_object's asset names"},
}};

/// Offsets, in floats, of each kept AOV inside one pixel's record; −1 when it is not kept.
struct FilmLayout {
  std::array<std::int16_t, kNumAovs> offset{};
  int num_floats = 0;  ///< per pixel
  int cryptomatte_levels = 0;
  int num_light_groups = 0;
};

/// Channels of one Cryptomatte: pairs of an id and its coverage, two pairs to a layer of four channels.
constexpr int cryptomatte_num_channels(int levels) { return (levels + 1) / 2 * 4; }

constexpr int aov_num_channels(const AovInfo& info, const FilmLayout& layout)
{
  if (info.channels.empty()) return cryptomatte_num_channels(layout.cryptomatte_levels);
  const int num_layers = info.aov == Aov::kLightGroups ? layout.num_light_groups : 1;
  return static_cast<int>(info.channels.size()) * num_layers;
}

/// The finished picture: plain floats, row 0 on top, averaged and normalized (no sums), owned elsewhere.
struct FilmView {
  const float* pixels = nullptr;  ///< width·height records of layout.num_floats
  int width = 0, height = 0;      ///< of the stored window (the crop, if there is one)
  int crop_x = 0, crop_y = 0;     ///< where the window lies in the full image
  int full_width = 0, full_height = 0;
  FilmLayout layout;
  const std::string* light_groups = nullptr;  ///< names of layout.num_light_groups
};

/// Layout that keeps the AOVs of a set, in enumerator order.
/// @param cryptomatte_levels  1 … kMostCryptomatteLevels
inline FilmLayout film_layout_make(AovMask aov_mask, int cryptomatte_levels = 6, int num_light_groups = 0)
{
  FilmLayout layout;
  layout.cryptomatte_levels = cryptomatte_levels;
  layout.num_light_groups = num_light_groups;
  for (int i = 0; i < kNumAovs; ++i) {
    const bool kept = aov_is_in(static_cast<Aov>(i), aov_mask);
    layout.offset[static_cast<std::size_t>(i)] = static_cast<std::int16_t>(kept ? layout.num_floats : -1);
    if (kept) layout.num_floats += aov_num_channels(kAovInfo[static_cast<std::size_t>(i)], layout);
  }
  return layout;
}

}  // namespace relief
