#include "scene/wide_texture.h"

namespace relief {
namespace {

/// As texture_sample_level.
template <int kChannels>
TexelValue wide_sample_level(const WideTexture& texture, int level, Vec2f uv)
{
  const TextureView& view = texture.view;
  const int width = mip_size(view.width, level), height = mip_size(view.height, level);
  const unsigned char* texels = texture.chain->level(level);
  const auto load = [&](int x, int y) {
    const std::size_t index =
        static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x);
    return texel_load_wide<kChannels>(texels + index * kChannels * sizeof(float));
  };
  if (view.filter == TexelFilter::kNearest) {
    return load(axis_nearest(uv.x, width, view.wrap_u), axis_nearest(uv.y, height, view.wrap_v));
  }
  const AxisTexels x = axis_linear(uv.x, width, view.wrap_u), y = axis_linear(uv.y, height, view.wrap_v);
  return texel_bilinear(load(x.i0, y.i0), load(x.i1, y.i0), load(x.i0, y.i1), load(x.i1, y.i1), x.t, y.t);
}

template <int kChannels>
Vec4f wide_sample(const void* handle, Vec2f uv, float width)
{
  const auto& texture = *static_cast<const WideTexture*>(handle);
  const MipSelection mip = mip_select(texture.view, width);
  TexelValue value = wide_sample_level<kChannels>(texture, mip.level, uv);
  if (mip.blend > 0.0f) {
    value += mip.blend * (wide_sample_level<kChannels>(texture, mip.level + 1, uv) - value);
  }
  return {value[0], value[1], value[2], value[3]};
}

}  // namespace

TextureView wide_texture_view(const WideTexture& texture)
{
  constexpr TextureView::Lookup kLookups[] = {wide_sample<1>, wide_sample<2>, wide_sample<3>, wide_sample<4>};
  TextureView view = texture.view;
  view.lookup = kLookups[view.num_channels - 1];
  view.lookup_handle = &texture;
  return view;
}

}  // namespace relief
